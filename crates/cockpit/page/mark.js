// Places to keep away from: drawn as a box on the picture, with the pointer or with the keyboard, and removed again.

import { byId, element, metres } from "./look.js";

/** A drag shorter than this is a click, CSS pixels. */
const DRAG = 10;

export class Marks {
  constructor(orders, picture) {
    [this.orders, this.picture, this.from, this.buttons] = [orders, picture, null, new Map()];
    const [button, canvas] = [byId("mark"), byId("picture")];
    button.onclick = () => this.arm(!this.on);
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    canvas.addEventListener("pointerup", (event) => this.up(event));
    canvas.addEventListener("pointercancel", () => this.drop());
    // The click that ends a drag does not point.
    canvas.addEventListener("click", (event) => {
      if (!this.dragged && !this.on) return;
      this.dragged = false;
      event.stopImmediatePropagation();
    }, { capture: true });
  }

  get on() {
    return byId("mark").getAttribute("aria-pressed") === "true";
  }

  get may() {
    return this.orders.flies && document.body.dataset.flight === "on";
  }

  arm(on) {
    byId("mark").setAttribute("aria-pressed", String(on && this.may));
    if (on) byId("point").setAttribute("aria-pressed", "false");
    this.drop();
    this.orders.arms();
  }

  down(event) {
    // A finger scrolls the page unless a box is to be drawn.
    if (!this.may || event.button !== 0 || (event.pointerType === "touch" && !this.on)) return;
    const at = this.picture.at(event);
    if (at) this.from = { ...at, x: event.clientX, y: event.clientY };
  }

  move(event) {
    if (!this.from || this.from.x === undefined) return;
    const far = Math.hypot(event.clientX - this.from.x, event.clientY - this.from.y) > DRAG;
    if (!far && !this.picture.rubber) return;
    if (!this.picture.rubber) byId("picture").setPointerCapture(event.pointerId);
    this.stretch(this.picture.nearest(event));
  }

  up(event) {
    if (!this.from || this.from.x === undefined) return;
    this.dragged = Boolean(this.picture.rubber);
    // Some browsers send no click after a drag.
    setTimeout(() => (this.dragged = false));
    if (this.dragged) this.send(this.picture.nearest(event));
    else this.drop();
  }

  /** With the keyboard: one corner, then the other. */
  enter(aim) {
    if (this.from) return this.send(aim);
    this.from = { ...aim };
    this.stretch(aim);
    this.orders.say("One corner is set: aim at the other one, and press Enter.");
  }

  /** The aim has moved. */
  aimed(aim) {
    if (this.from) this.stretch(aim);
  }

  stretch(to) {
    this.picture.rubber = box(this.from, to);
    this.picture.overlay();
  }

  drop() {
    [this.from, this.picture.rubber] = [null, null];
    this.picture.overlay();
  }

  async send(to) {
    const [area, head] = [box(this.from, to), this.picture.head];
    this.drop();
    if (!head || area[0] === area[2] || area[1] === area[3]) return;
    const focused = document.activeElement === byId("picture");
    const answer = await this.orders.give({ avoid: { area, depth: Number(byId("distance").value), frame: head.frame } });
    if (!answer.ok) return;
    this.arm(false);
    // The picture takes the focus no longer: without a place of its own the next arrow would fly.
    if (focused && this.on === false && !byId("picture").hasAttribute("tabindex")) byId("mark").focus();
  }

  /** The marked places, as the flight has them; the picture tells how far away those in view are. */
  list(marked) {
    const near = new Map((this.picture.head?.overlay?.marked ?? []).map((place) => [place.id, place.metres]));
    const ids = new Set(marked.map(({ id }) => id));
    const say = (id, what) => this.orders.say(`Place ${id + 1} ${what}.`);
    for (const [id, { item, button }] of this.buttons) {
      if (ids.has(id)) continue;
      const focused = document.activeElement === button;
      item.remove();
      this.buttons.delete(id);
      if (focused) byId("mark").focus();
      if (document.body.dataset.flight === "on") say(id, "removed");
    }
    for (const { id } of marked) {
      if (!this.buttons.has(id)) {
        this.buttons.set(id, this.button(id));
        say(id, "is kept away from");
      }
      const { button } = this.buttons.get(id);
      const text = `Place ${id + 1}${near.has(id) ? ` · ${metres(near.get(id), 0)}` : ""} ✕`;
      if (button.textContent !== text) button.textContent = text;
    }
    byId("marked").hidden = marked.length === 0;
  }

  button(id) {
    const [item, button] = [element("li"), element("button", "", { type: "button", class: "plain", "aria-label": `Remove place ${id + 1}` })];
    button.onclick = () => this.orders.give({ unavoid: id });
    item.append(button);
    byId("marked-list").append(item);
    return { item, button };
  }
}

function box(a, b) {
  return [Math.min(a.u, b.u), Math.min(a.v, b.v), Math.max(a.u, b.u), Math.max(a.v, b.v)];
}
