// What is drawn over pictures: boxes, places, paths, targets.

import { metres, roughly } from "./look.js";

function stroke(c, colour, width) {
  for (const [style, extra] of [["rgb(0 0 0 / 65%)", 2.5], [colour, 0]]) {
    [c.strokeStyle, c.lineWidth] = [style, width + extra];
    c.stroke();
  }
}

export function horizon(c, [[u0, v0], [u1, v1]], x, y, area) {
  const slope = (v1 - v0) / (u1 - u0 || 1);
  const at = (u) => v0 + (u - u0) * slope;
  c.globalAlpha = 0.55;
  c.setLineDash([2, 7]);
  c.beginPath();
  c.moveTo(area.left, y(at(0)));
  c.lineTo(area.left + area.width, y(at(1)));
  stroke(c, "#ffffff", 1.2);
  c.setLineDash([]);
  c.globalAlpha = 1;
}

export function box(c, [left, top, right, bottom], x, y, colour, dash, label) {
  c.setLineDash(dash);
  c.beginPath();
  c.rect(x(left), y(top), x(right) - x(left), y(bottom) - y(top));
  stroke(c, colour, 2);
  c.setLineDash([]);
  if (label) text(c, label, x(left) + 6, y(top) - 4, colour, undefined, 12);
}

/** A place to keep away from. */
export function place(c, { id, area: [left, top, right, bottom], metres: away }, x, y) {
  c.save();
  c.beginPath();
  c.rect(x(left), y(top), x(right) - x(left), y(bottom) - y(top));
  c.fillStyle = "rgb(214 40 28 / 22%)";
  c.fill();
  stroke(c, "#ff6b5e", 2.5);
  c.clip();
  c.beginPath();
  for (let at = x(left) - (y(bottom) - y(top)); at < x(right); at += 16) {
    c.moveTo(at, y(bottom));
    c.lineTo(at + y(bottom) - y(top), y(top));
  }
  [c.strokeStyle, c.lineWidth] = ["rgb(255 107 94 / 60%)", 1.5];
  c.stroke();
  c.restore();
  text(c, `keep away ${id + 1} · ${roughly(away)}`, x(left) + 8, y(bottom) - 10, "#ff9a90", undefined, 12);
}

export function line(c, points, x, y, colour) {
  c.beginPath();
  points.forEach(([u, v], i) => (i ? c.lineTo(x(u), y(v)) : c.moveTo(x(u), y(v))));
  stroke(c, colour, 3);
}

export function target(c, px, py, label, area) {
  c.beginPath();
  c.arc(px, py, 13, 0, 2 * Math.PI);
  for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
    c.moveTo(px + 9 * dx, py + 9 * dy);
    c.lineTo(px + 20 * dx, py + 20 * dy);
  }
  stroke(c, "#ffc233", 2.4);
  c.font = "600 14px system-ui, sans-serif";
  const wide = c.measureText(label).width + 16;
  const left = px + 24 + wide > area.left + area.width ? px - 24 - wide : px + 24;
  text(c, label, left + 8, py + 5, "#ffc233", wide);
}

export function cross(c, px, py, colour) {
  c.beginPath();
  c.arc(px, py, 16, 0, 2 * Math.PI);
  c.moveTo(px - 24, py); c.lineTo(px - 6, py); c.moveTo(px + 6, py); c.lineTo(px + 24, py);
  c.moveTo(px, py - 24); c.lineTo(px, py - 6); c.moveTo(px, py + 6); c.lineTo(px, py + 24);
  stroke(c, colour, 2);
}

function text(c, words, px, py, colour, wide, size = 14) {
  c.font = `600 ${size}px system-ui, sans-serif`;
  const width = wide ?? c.measureText(words).width + 12;
  c.fillStyle = "rgb(6 9 14 / 78%)";
  c.beginPath();
  // Older browsers have no round corners.
  c[c.roundRect ? "roundRect" : "rect"](px - (wide ? 8 : 6), py - size - 2, width, size + 9, 6);
  c.fill();
  c.fillStyle = colour;
  c.fillText(words, px, py);
}

/** What the drone flies to: the place of its target, or the end of a step towards it. */
export function caption({ label, metres: away, target }) {
  const far = away < 20 ? metres(away) : roughly(away);
  return `${target ? label || "target" : "waypoint"} · ${far}`;
}
