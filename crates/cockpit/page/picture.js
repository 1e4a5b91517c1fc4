// The live picture, what is drawn over it, and pointing in it.

import { box, caption, cross, horizon, line, place, target } from "./draw.js";
import { byId, sharp } from "./look.js";

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
    this.canvas.dataset.frame = head.frame;
    this.canvas.dataset.latency = Math.round(1000 * head.received + performance.now() - arrived);
    byId("empty").hidden = true;
    this.overlay();
  }

  clear(text) {
    this.head = null;
    this.marks = [];
    byId("empty").hidden = false;
    byId("empty-text").textContent = text;
    this.age();
    this.overlay();
  }

  /** Age of the picture now, seconds, by the clock of the drone's side. */
  get seconds() {
    return this.head ? this.head.age + (performance.now() - this.arrived) / 1000 : null;
  }

  /** Tells the age of the picture: one figure, that of what is seen here. After a flight the last picture stays, and is no longer live. */
  age() {
    const live = document.body.dataset.flight === "on";
    const age = live ? this.seconds : null;
    const old = age !== null && age > OLD;
    const text = age === null ? "–" : old ? `${age.toFixed(1)} s` : `${Math.round(age * 1000)} ms`;
    byId("stage").classList.toggle("old", old);
    this.aged?.(old);
    byId("age").textContent = old ? `picture ${text} old` : "";
    byId("picture-age").textContent = text;
    byId("picture-age").className = old ? "bad" : age > OLD / 2 ? "warn" : "";
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
    if (over.horizon) horizon(c, over.horizon, x, y, area);
    for (const { area, label } of over.boxes ?? []) box(c, area, x, y, "#ff8d6b", [6, 4], label);
    for (const marked of over.marked ?? []) place(c, marked, x, y);
    if (this.rubber) box(c, this.rubber, x, y, "#ff6b5e", [4, 4], "");
    if (over.track) box(c, over.track.area, x, y, over.track.sure ? "#5fe08a" : "#c4ecd0", over.track.sure ? [] : [3, 4], "");
    if (over.path?.length > 1) line(c, over.path, x, y, "#55c7ff");
    if (over.point) target(c, x(over.point.u), y(over.point.v), caption(over.point), area);
    for (const mark of this.marks.filter((mark) => mark.until > performance.now())) cross(c, x(mark.u), y(mark.v), "#ffffff");
    if (this.aim) cross(c, x(this.aim.u), y(this.aim.v), "#ffc233");
    c.restore();
  }
}
