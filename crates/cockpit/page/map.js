// The map from above: the scene where it is known, fence, obstacles, the flown and the planned path, the craft and its target.

import { byId, colour, sharp } from "./look.js";

const CLOSEST = 6;

export class MapView {
  constructor() {
    this.canvas = byId("map");
    this.radius = 0;
    this.clear();
    byId("map-in").onclick = () => this.zoom(0.6);
    byId("map-out").onclick = () => this.zoom(1 / 0.6);
    byId("map-all").onclick = () => { this.radius = 0; this.draw(); };
    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(event.deltaY > 0 ? 1.2 : 1 / 1.2);
    }, { passive: false });
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    matchMedia("(prefers-color-scheme: light)").addEventListener("change", () => this.draw());
  }

  clear() {
    [this.outlines, this.fence, this.path, this.cells, this.offset, this.state, this.decisions] = [[], [], [], [], [0, 0], null, []];
    this.draw();
  }

  zoom(by) {
    this.radius = Math.max(CLOSEST, Math.min(500, (this.radius || this.fitting()) * by));
    this.draw();
  }

  /** The radius around the craft that shows the flight so far and its goal, metres. */
  fitting() {
    const [east, north] = this.state?.at ?? [0, 0];
    const anchor = this.state?.anchor;
    const points = [...this.path, this.state?.goal, anchor?.at].filter(Boolean);
    const far = points.map(([e, n]) => Math.max(Math.abs(e - east), Math.abs(n - north)));
    // The buttons must not cover the target.
    return Math.max(24, Math.min(250, 1.45 * Math.max(0, ...far) + Math.min(20, anchor?.sd ?? 0)));
  }

  fly(state) {
    this.state = state;
    const last = this.path.at(-1);
    if (state.phase !== "ground" && (!last || Math.hypot(last[0] - state.at[0], last[1] - state.at[1]) > 0.15)) this.path.push(state.at);
    if (this.path.length > 6000) this.path = this.path.filter((_, i) => i % 2 === 0);
    this.canvas.setAttribute("aria-label", `Map from above: the drone is ${Math.round(Math.hypot(...state.at))} metres from the origin, heading ${Math.round(state.heading)} degrees`);
    this.draw();
  }

  draw() {
    const { context: c, width, height } = sharp(this.canvas);
    const state = this.state;
    c.fillStyle = colour("panel");
    c.fillRect(0, 0, width, height);
    const [east, north] = state?.at ?? [0, 0];
    const scale = Math.min(width, height) / 2 / (this.radius || this.fitting());
    const [x, y] = [(e) => width / 2 + (e - east) * scale, (n) => height / 2 - (n - north) * scale];
    const trace = (points, closed) => {
      points.forEach(([e, n], i) => (i ? c.lineTo(x(e), y(n)) : c.moveTo(x(e), y(n))));
      if (closed) c.closePath();
    };
    const [de, dn] = this.offset;
    const light = matchMedia("(prefers-color-scheme: light)").matches;
    c.lineJoin = "round";
    c.lineWidth = 1;
    for (const outline of this.outlines) {
      c.beginPath();
      for (const ring of outline.rings) trace(ring.map(([e, n]) => [e + de, n + dn]), true);
      c.fillStyle = outline.colour;
      c.globalAlpha = light ? 0.75 : 0.42;
      c.fill("evenodd");
      c.globalAlpha = 0.35;
      c.strokeStyle = colour("text");
      c.stroke();
      c.globalAlpha = 1;
    }
    c.fillStyle = "#d6542f";
    for (const [e, n] of this.cells) c.fillRect(x(e) - scale / 8, y(n) - scale / 8, Math.max(2, scale / 4), Math.max(2, scale / 4));
    for (const ring of this.fence) {
      c.beginPath();
      trace(ring, true);
      [c.strokeStyle, c.lineWidth] = [colour("bad"), 2];
      c.setLineDash([8, 5]);
      c.stroke();
      c.setLineDash([]);
    }
    this.ways(c, trace, x, y, scale);
    if (state) this.craft(c, width / 2, height / 2, state, scale);
    this.rule(c, width, height, scale);
  }

  ways(c, trace, x, y, scale) {
    const { path: planned, goal, anchor } = this.state ?? {};
    c.beginPath();
    trace(this.path, false);
    [c.strokeStyle, c.lineWidth] = [colour("hold"), 3];
    c.stroke();
    c.fillStyle = colour("text");
    for (const [e, n] of this.decisions) {
      c.beginPath();
      c.arc(x(e), y(n), 2.5, 0, 2 * Math.PI);
      c.fill();
    }
    for (const { id, ends } of this.state?.marked ?? []) {
      c.beginPath();
      trace(ends, false);
      [c.strokeStyle, c.lineWidth] = [colour("bad"), 5];
      c.stroke();
      c.font = "600 12px system-ui, sans-serif";
      c.fillStyle = colour("bad");
      c.fillText(String(id + 1), (x(ends[0][0]) + x(ends[1][0])) / 2 + 6, (y(ends[0][1]) + y(ends[1][1])) / 2 - 6);
    }
    if (planned?.length > 1) {
      c.beginPath();
      trace(planned, false);
      [c.strokeStyle, c.lineWidth] = ["#2a9fd6", 3];
      c.setLineDash([5, 4]);
      c.stroke();
      c.setLineDash([]);
    }
    const target = anchor?.at ?? goal;
    if (!target) return;
    [c.strokeStyle, c.lineWidth] = [colour("accent"), 2.5];
    c.beginPath();
    c.arc(x(target[0]), y(target[1]), 6, 0, 2 * Math.PI);
    c.stroke();
    if (anchor) {
      c.globalAlpha = 0.5;
      c.beginPath();
      c.arc(x(target[0]), y(target[1]), Math.max(7, anchor.sd * scale), 0, 2 * Math.PI);
      c.stroke();
      c.globalAlpha = 1;
    }
  }

  craft(c, px, py, state, scale) {
    if (state.sigma) {
      [c.strokeStyle, c.lineWidth] = [colour("faint"), 1.5];
      c.beginPath();
      c.arc(px, py, Math.max(10, state.sigma * scale), 0, 2 * Math.PI);
      c.stroke();
    }
    c.save();
    c.translate(px, py);
    c.rotate((state.heading * Math.PI) / 180);
    c.beginPath();
    c.moveTo(0, -11); c.lineTo(8, 9); c.lineTo(0, 5); c.lineTo(-8, 9);
    c.closePath();
    [c.fillStyle, c.strokeStyle, c.lineWidth] = [colour("text"), colour("panel"), 2];
    c.stroke();
    c.fill();
    c.restore();
  }

  /** A scale bar and the north. */
  rule(c, width, height, scale) {
    const round = [1, 2, 5, 10, 20, 50, 100, 200].find((length) => length * scale > 50) ?? 200;
    [c.strokeStyle, c.fillStyle, c.lineWidth] = [colour("text"), colour("text"), 2];
    c.font = "12px system-ui, sans-serif";
    c.beginPath();
    c.moveTo(12, height - 14);
    c.lineTo(12 + round * scale, height - 14);
    c.stroke();
    for (const [text, y] of [[`${round} m`, height - 20], ["N ↑", 20]]) {
      [c.strokeStyle, c.lineWidth] = [colour("panel"), 3.5];
      c.strokeText(text, 12, y);
      c.fillText(text, 12, y);
    }
  }
}
