// The live picture, what is drawn over it, and pointing in it.

import { byId, metres, roughly, sharp } from "./look.js";

const OLD = 1.0;

export class Picture {
  constructor(confirm) {
    this.canvas = byId("picture");
    this.context = this.canvas.getContext("2d", { alpha: false });
    this.confirm = confirm;
    this.head = null;
    this.arrived = 0;
    this.aim = null;
    this.marks = [];
    this.rubber = null;
    new ResizeObserver(() => this.fit()).observe(byId("stage"));
    setInterval(() => this.age(), 100);
  }

  /** Shows a JPEG. Only one is decoded at a time; the server sends no more. */
  async show(head, jpeg) {
    const arrived = performance.now();
    const bitmap = await createImageBitmap(new Blob([jpeg], { type: "image/jpeg" }));
    this.paint(head, bitmap, bitmap.width, bitmap.height, arrived);
    bitmap.close();
    this.canvas.dataset.format = "jpeg";
  }

  /** Shows an image of the film. */
  frame(head, frame, arrived) {
    this.paint(head, frame, frame.displayWidth, frame.displayHeight, arrived);
    this.canvas.dataset.format = "film";
  }

  paint(head, image, width, height, arrived) {
    if (this.canvas.width !== width || this.canvas.height !== height) {
      [this.canvas.width, this.canvas.height] = [width, height];
      this.fit();
    }
    this.context.drawImage(image, 0, 0);
    [this.head, this.arrived] = [head, arrived];
    this.confirm();
    // From the frame's arrival at the program to its pixels, but for the way here: for measurements.
    this.canvas.dataset.latency = Math.round(1000 * head.received + performance.now() - arrived);
    byId("empty").hidden = true;
    this.overlay();
  }

  clear(text) {
    this.head = null;
    this.marks = [];
    byId("empty").hidden = false;
    byId("empty-text").textContent = text;
    byId("age").textContent = "";
    this.overlay();
  }

  /** Age of the picture now, seconds, by the clock of the drone's side. */
  get seconds() {
    return this.head ? this.head.age + (performance.now() - this.arrived) / 1000 : null;
  }

  age() {
    const age = this.seconds;
    const pill = byId("age");
    const old = age !== null && age > OLD;
    byId("stage").classList.toggle("old", old);
    pill.classList.toggle("bad", old);
    if (age !== null) pill.textContent = old ? `picture ${age.toFixed(1)} s old` : `${Math.round(age * 1000)} ms`;
  }

  /** The part of the stage that the picture fills, CSS pixels. */
  area() {
    const { width, height } = byId("stage").getBoundingClientRect();
    const scale = Math.min(width / this.canvas.width, height / this.canvas.height);
    const [w, h] = [this.canvas.width * scale, this.canvas.height * scale];
    return { left: (width - w) / 2, top: (height - h) / 2, width: w, height: h };
  }

  /** The point of the picture below a pointer, as fractions; null beside it. */
  at(event) {
    const [stage, area] = [byId("stage").getBoundingClientRect(), this.area()];
    const u = (event.clientX - stage.left - area.left) / area.width;
    const v = (event.clientY - stage.top - area.top) / area.height;
    return u >= 0 && u <= 1 && v >= 0 && v <= 1 ? { u, v } : null;
  }

  /** The same, or the nearest point of its edge. */
  nearest(event) {
    const [stage, area] = [byId("stage").getBoundingClientRect(), this.area()];
    const inside = (value) => Math.max(0, Math.min(1, value));
    return { u: inside((event.clientX - stage.left - area.left) / area.width), v: inside((event.clientY - stage.top - area.top) / area.height) };
  }

  /** Gives the canvas the shape of the picture, as large as there is room. */
  fit() {
    const { width, height } = this.area();
    [this.canvas.style.width, this.canvas.style.height] = [`${width}px`, `${height}px`];
    this.overlay();
  }

  /** Remembers where somebody pointed, to show it for a while. */
  pointed(point) {
    this.marks = [{ ...point, until: performance.now() + 2500 }];
    this.overlay();
    setTimeout(() => this.overlay(), 2600);
  }

  overlay() {
    const { context: c } = sharp(byId("overlay"));
    const area = this.area();
    const [x, y] = [(u) => area.left + u * area.width, (v) => area.top + v * area.height];
    c.save();
    c.beginPath();
    c.rect(area.left, area.top, area.width, area.height);
    c.clip();
    c.lineJoin = c.lineCap = "round";
    const over = this.head?.overlay ?? {};
    if (over.horizon) this.horizon(c, over.horizon, x, y, area);
    for (const box of over.boxes ?? []) this.box(c, box.area, x, y, "#ff8d6b", [6, 4], box.label);
    for (const place of over.marked ?? []) this.place(c, place, x, y);
    if (this.rubber) this.box(c, this.rubber, x, y, "#ff6b5e", [4, 4], "");
    if (over.track) this.box(c, over.track.area, x, y, over.track.sure ? "#5fe08a" : "#c4ecd0", over.track.sure ? [] : [3, 4], "");
    if (over.path?.length > 1) this.line(c, over.path, x, y, "#55c7ff");
    if (over.point) this.target(c, x(over.point.u), y(over.point.v), caption(over.point), area);
    for (const mark of this.marks.filter((mark) => mark.until > performance.now())) this.cross(c, x(mark.u), y(mark.v), "#ffffff");
    if (this.aim) this.cross(c, x(this.aim.u), y(this.aim.v), "#ffc233");
    c.restore();
  }

  stroke(c, colour, width) {
    for (const [style, extra] of [["rgb(0 0 0 / 65%)", 2.5], [colour, 0]]) {
      [c.strokeStyle, c.lineWidth] = [style, width + extra];
      c.stroke();
    }
  }

  horizon(c, [[u0, v0], [u1, v1]], x, y, area) {
    const slope = (v1 - v0) / (u1 - u0 || 1);
    const at = (u) => v0 + (u - u0) * slope;
    c.globalAlpha = 0.55;
    c.setLineDash([2, 7]);
    c.beginPath();
    c.moveTo(area.left, y(at(0)));
    c.lineTo(area.left + area.width, y(at(1)));
    this.stroke(c, "#ffffff", 1.2);
    c.setLineDash([]);
    c.globalAlpha = 1;
  }

  box(c, [left, top, right, bottom], x, y, colour, dash, label) {
    c.setLineDash(dash);
    c.beginPath();
    c.rect(x(left), y(top), x(right) - x(left), y(bottom) - y(top));
    this.stroke(c, colour, 2);
    c.setLineDash([]);
    if (label) this.text(c, label, x(left) + 6, y(top) - 4, colour, undefined, 12);
  }

  /** A place to keep away from. */
  place(c, { id, area: [left, top, right, bottom], metres: away }, x, y) {
    c.save();
    c.beginPath();
    c.rect(x(left), y(top), x(right) - x(left), y(bottom) - y(top));
    c.fillStyle = "rgb(214 40 28 / 22%)";
    c.fill();
    this.stroke(c, "#ff6b5e", 2.5);
    c.clip();
    c.beginPath();
    for (let at = x(left) - (y(bottom) - y(top)); at < x(right); at += 16) {
      c.moveTo(at, y(bottom));
      c.lineTo(at + y(bottom) - y(top), y(top));
    }
    [c.strokeStyle, c.lineWidth] = ["rgb(255 107 94 / 60%)", 1.5];
    c.stroke();
    c.restore();
    this.text(c, `keep away ${id + 1} · ${roughly(away)}`, x(left) + 8, y(bottom) - 10, "#ff9a90", undefined, 12);
  }

  line(c, points, x, y, colour) {
    c.beginPath();
    points.forEach(([u, v], i) => (i ? c.lineTo(x(u), y(v)) : c.moveTo(x(u), y(v))));
    this.stroke(c, colour, 3);
  }

  target(c, px, py, label, area) {
    c.beginPath();
    c.arc(px, py, 13, 0, 2 * Math.PI);
    for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
      c.moveTo(px + 9 * dx, py + 9 * dy);
      c.lineTo(px + 20 * dx, py + 20 * dy);
    }
    this.stroke(c, "#ffc233", 2.4);
    c.font = "600 14px system-ui, sans-serif";
    const wide = c.measureText(label).width + 16;
    const left = px + 24 + wide > area.left + area.width ? px - 24 - wide : px + 24;
    this.text(c, label, left + 8, py + 5, "#ffc233", wide);
  }

  cross(c, px, py, colour) {
    c.beginPath();
    c.arc(px, py, 16, 0, 2 * Math.PI);
    c.moveTo(px - 24, py); c.lineTo(px - 6, py); c.moveTo(px + 6, py); c.lineTo(px + 24, py);
    c.moveTo(px, py - 24); c.lineTo(px, py - 6); c.moveTo(px, py + 6); c.lineTo(px, py + 24);
    this.stroke(c, colour, 2);
  }

  text(c, text, px, py, colour, wide, size = 14) {
    c.font = `600 ${size}px system-ui, sans-serif`;
    const width = wide ?? c.measureText(text).width + 12;
    c.fillStyle = "rgb(6 9 14 / 78%)";
    c.beginPath();
    // Older browsers have no round corners.
    c[c.roundRect ? "roundRect" : "rect"](px - (wide ? 8 : 6), py - size - 2, width, size + 9, 6);
    c.fill();
    c.fillStyle = colour;
    c.fillText(text, px, py);
  }
}

/** What the drone flies to: the place of its target, or the end of a step towards it. */
export function caption({ label, metres: away, target }) {
  const far = away < 20 ? metres(away) : roughly(away);
  return `${target ? label || "target" : "waypoint"} · ${far}`;
}
