// Cutting the motors: offered by one button, and done by a deliberate gesture elsewhere on the page.

import { byId } from "./look.js";

/** The ring is held for this long, and offered for this long, milliseconds. The program waits 6 s after the offer. */
const HELD = 1500;
const OFFERED = 4000;
/** A frame counts for this long at most: a page that was busy does not know yet whether the ring was let go. */
const FRAME = 100;
/** The key that cuts once it is offered; another one than those that press a button, and far from those that fly. */
const KEY = "k";

const OFF = { is: "off" };

export class Cut {
  constructor(orders) {
    [this.orders, this.state] = [orders, OFF];
    const ring = byId("ring");
    ring.addEventListener("pointerdown", (event) => this.down(event));
    ring.addEventListener("pointermove", (event) => this.of(event) && !inside(ring, event) && this.drop("moved away"));
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
      ring.addEventListener(end, (event) => this.of(event) && this.drop("let go too early"));
    }
    // A long touch is no wish for a menu.
    ring.addEventListener("contextmenu", (event) => event.preventDefault());
    addEventListener("blur", () => this.drop("the window lost the focus"));
    document.addEventListener("visibilitychange", () => document.hidden && this.drop("the page was hidden"));
  }

  /** The first step. What is held elsewhere, a key or the pad, goes on. */
  async offer() {
    if (this.state !== OFF) return;
    const offered = { is: "offered" };
    this.state = offered;
    const answer = await this.orders.give("arm_cut");
    if (this.state !== offered) return;
    if (!answer.ok) return this.drop();
    this.show(true);
    offered.timer = setTimeout(() => this.state === offered && this.drop("not confirmed"), OFFERED);
  }

  /** The second step by the keyboard. Whether the key was for this. */
  key(event) {
    if (this.state.is !== "offered" || byId("cutting").hidden || event.repeat) return false;
    if (event.key.toLowerCase() !== KEY && event.code !== "KeyK") return false;
    this.cut();
    return true;
  }

  down(event) {
    if (this.state.is !== "offered" || event.button !== 0) return;
    event.preventDefault();
    clearTimeout(this.state.timer);
    byId("ring").setPointerCapture(event.pointerId);
    const held = { is: "held", pointer: event.pointerId, time: 0, last: performance.now() };
    this.state = held;
    const frame = (now) => {
      if (this.state !== held) return;
      held.time += Math.max(0, Math.min(FRAME, now - held.last));
      held.last = now;
      byId("ring").style.setProperty("--filled", Math.min(1, held.time / HELD));
      if (held.time >= HELD) this.cut();
      else requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  /** Whether an event is of the pointer that holds the ring. */
  of(event) {
    return this.state.is === "held" && this.state.pointer === event.pointerId;
  }

  cut() {
    this.drop();
    this.orders.stop("cut", "cut");
  }

  /** Nothing is cut. */
  drop(why) {
    if (this.state === OFF) return;
    clearTimeout(this.state.timer);
    this.state = OFF;
    this.show(false);
    if (why) this.orders.say(`Motors not cut: ${why}.`);
  }

  show(on) {
    const focused = document.activeElement === byId("ring");
    byId("cutting").hidden = !on;
    byId("cut").setAttribute("aria-expanded", String(on));
    byId("ring").style.setProperty("--filled", 0);
    if (!on && focused) byId("cut").focus();
  }
}

function inside(element, { clientX, clientY }) {
  const { left, top, right, bottom } = element.getBoundingClientRect();
  return clientX >= left && clientX <= right && clientY >= top && clientY <= bottom;
}
