// Orders: to stop, to point, to fly by hand.

import { Cut } from "./cut.js";
import { METRES, byId, isTyping, metres, roughly } from "./look.js";

/** Manual flight is sent anew this often; the drone holds if it comes no more. */
const REPEAT = 100;
/** After the picture had the focus, keys fly nothing for this long, milliseconds. */
const AIMED = 1000;
/** A click so soon after a button was touched, or let go, is the same press, milliseconds. */
const CLICK = 700;
const KEYS = {
  ArrowUp: ["forward", 1], ArrowDown: ["forward", -1], ArrowLeft: ["right", -1], ArrowRight: ["right", 1],
  KeyW: ["up", 1], KeyS: ["up", -1], KeyA: ["turn", -1], KeyD: ["turn", 1],
};

/**
 * Does it when the button is touched: a click waits until the finger leaves, and is of the first finger only, while another one may be
 * on the pad. Keyboards and screen readers send a click alone.
 */
function touched(button, act) {
  let last = -Infinity;
  button.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    last = performance.now();
    act();
  });
  button.addEventListener("pointerup", () => (last = performance.now()));
  button.addEventListener("click", () => performance.now() - last > CLICK && act());
}

export class Orders {
  constructor(controls, picture) {
    [this.controls, this.picture, this.held, this.asked, this.human, this.steps] = [controls, picture, new Map(), null, false, null];
    this.cut = new Cut(this);
    for (const [button, what] of [["hold", "hold"], ["land", "land"], ["held-land", "land"]]) touched(byId(button), () => this.stop(what, button));
    touched(byId("cut"), () => this.cut.offer());
    for (const button of ["resume", "held-resume"]) byId(button).onclick = () => this.give("resume");
    document.addEventListener("keydown", (event) => {
      this.chord(event);
      this.key(event);
    });
    document.addEventListener("keyup", (event) => {
      this.chord(event);
      if (event.code === "Space" && !isTyping(event.target)) event.preventDefault();
      this.let(event.code);
    });
    this.pointing();
    this.manual();
  }

  get flies() {
    return document.body.dataset.role === "pilot";
  }

  say(text, ok = true) {
    const ack = byId("ack");
    [ack.textContent, ack.className] = [text, ok ? "yes" : "no"];
    clearTimeout(this.fading);
    this.fading = setTimeout(() => (ack.textContent = ""), 6000);
  }

  async give(what) {
    const answer = await this.controls.order(what);
    if (answer.text || !answer.ok) this.say(answer.text, answer.ok);
    return answer;
  }

  /** An order to stop: the button shows that it was sent, and then that it was received. */
  async stop(what, button) {
    // Before anything that could fail. After it nothing may be flown by hand: that would end it.
    const sent = this.controls.order(what);
    const pressed = byId(button);
    try {
      this.release(false);
      this.cut.drop();
      pressed.classList.add("sent");
      byId("point").setAttribute("aria-pressed", "false");
      this.marks?.arm(false);
    } catch (error) {
      console.error(error);
    }
    const answer = await sent;
    pressed.classList.remove("sent");
    pressed.classList.toggle("done", answer.ok);
    setTimeout(() => pressed.classList.remove("done"), 1200);
    const words = { hold: "Hold: received", land: "Land: received", cut: "Motors cut" };
    this.say(answer.ok ? `${words[what]} after ${Math.round(answer.ms)} ms` : answer.text, answer.ok);
  }

  /** With Meta, Control or Alt held, browsers may send no keyup for other keys: nothing is flown on. */
  chord(event) {
    if (event.metaKey || event.ctrlKey || event.altKey || ["Meta", "Control", "Alt"].includes(event.key)) this.release();
  }

  key(event) {
    if (!this.flies || event.ctrlKey || event.metaKey || event.altKey) return;
    if (isTyping(event.target)) {
      if (event.key === "Escape") event.target.blur();
      return;
    }
    if (event.code === "Space") {
      event.preventDefault();
      if (!event.repeat) this.stop("hold", "hold");
    } else if (event.key === "Escape") {
      event.preventDefault();
      if (!event.repeat) this.stop("land", "land");
    } else if (this.cut.key(event)) {
      event.preventDefault();
    } else if (document.activeElement === byId("picture") && this.aims(event)) {
      event.preventDefault();
    } else if (byId("manual").open && KEYS[event.code] && !(event.target instanceof HTMLInputElement)) {
      event.preventDefault();
      // An arrow that was meant for the aim flies nothing.
      if (!event.repeat && !this.aimed) this.press(event.code, ...KEYS[event.code]);
    }
  }

  // Pointing.

  pointing() {
    const [point, distance, canvas] = [byId("point"), byId("distance"), byId("picture")];
    point.onclick = () => {
      const on = point.getAttribute("aria-pressed") !== "true";
      point.setAttribute("aria-pressed", String(on));
      if (on) this.marks?.arm(false);
      this.arms();
    };
    const tell = () => {
      const [text, most] = [roughly(METRES[distance.value - 1]), distance.value === "10"];
      byId("distance-out").textContent = most ? `≥ ${text}` : text;
      distance.setAttribute("aria-valuetext", most ? `${text} or more` : text);
      this.explain();
    };
    distance.oninput = tell;
    tell();
    canvas.addEventListener("click", (event) => {
      const at = this.picture.at(event);
      if (at && this.armed_to_point) this.send(at);
    });
    canvas.addEventListener("wheel", (event) => {
      if (!this.aiming) return;
      event.preventDefault();
      distance.value = Number(distance.value) + (event.deltaY < 0 ? 1 : -1);
      tell();
    }, { passive: false });
    canvas.addEventListener("focus", () => {
      // Not for who only clicks.
      if (this.aiming && canvas.matches(":focus-visible")) this.picture.aim ??= { u: 0.5, v: 0.5 };
      this.explain();
      this.picture.overlay();
    });
    canvas.addEventListener("blur", () => {
      this.left = performance.now();
      this.picture.aim = null;
      this.explain();
      this.picture.overlay();
    });
    for (const button of document.querySelectorAll("[data-look]")) button.onclick = () => this.give({ look: button.dataset.look });
    byId("done").onclick = () => this.give("done");
  }

  /** Whether the picture takes points, and not the corners of a box. */
  get armed_to_point() {
    return this.flies && !this.marks?.on && (this.human || byId("point").getAttribute("aria-pressed") === "true");
  }

  /** Whether the picture has the focus, or had it a moment ago. */
  get aimed() {
    return document.activeElement === byId("picture") || performance.now() - (this.left ?? -Infinity) < AIMED;
  }

  get aiming() {
    return this.armed_to_point || (this.flies && this.marks?.on);
  }

  /** Shows whether a click in the picture points. */
  arms() {
    document.body.classList.toggle("points", this.armed_to_point);
    document.body.classList.toggle("draws", Boolean(this.marks?.on));
    this.explain();
    if (this.aiming) byId("picture").tabIndex = 0;
    else {
      if (document.activeElement === byId("picture")) this.left = performance.now();
      byId("picture").removeAttribute("tabindex");
    }
  }

  /** Says how to point, and how far the drone then flies. */
  explain() {
    const label = byId("distance").value;
    const after = this.human ? "and asks again" : "then the model answers again";
    // With the target's estimated place it is the way there that counts, and else the step that the distance means.
    const step = this.steps ? `The drone flies ${metres(this.steps[label - 1])} towards it (its step at ${roughly(METRES[label - 1])})` : `The drone flies towards it, ${roughly(METRES[label - 1])} at most`;
    const drawn = this.marks?.on;
    const text = this.picture.aim
      ? `Arrow keys aim (with Shift in larger steps), Enter ${drawn ? "sets one corner, and the other" : "points"}.`
      : drawn
        ? "Draw a box around what to keep away from, with its distance set above. With keys: Tab to the picture, arrows aim, Enter sets one corner, and the other. This button again ends it; Escape lands the drone."
        : `${this.armed_to_point ? "Set" : "A correction: press “Not that one, this …”, set"} how far away it is, and click on it. ${step}, ${after}.`;
    if (byId("how").textContent !== text) byId("how").textContent = text;
  }

  aims(event) {
    const step = event.shiftKey ? 0.1 : 0.02;
    const moves = { ArrowUp: [0, -step], ArrowDown: [0, step], ArrowLeft: [-step, 0], ArrowRight: [step, 0] };
    if (event.key === "Enter" && this.picture.aim && this.aiming) {
      if (this.marks?.on) this.marks.enter(this.picture.aim);
      else this.send(this.picture.aim);
      return true;
    }
    if (!moves[event.key] || !this.aiming) return false;
    this.picture.aim ??= { u: 0.5, v: 0.5 };
    const clamp = (value) => Math.max(0, Math.min(1, value));
    const [du, dv] = moves[event.key];
    this.picture.aim = { u: clamp(this.picture.aim.u + du), v: clamp(this.picture.aim.v + dv) };
    this.marks?.aimed(this.picture.aim);
    this.picture.overlay();
    return true;
  }

  async send({ u, v }) {
    const head = this.picture.head;
    if (!head) return;
    const answer = await this.give({ point: { u, v, depth: Number(byId("distance").value), frame: head.frame } });
    if (answer.ok) this.picture.pointed({ u, v });
    if (answer.ok) byId("point").setAttribute("aria-pressed", "false");
    this.arms();
  }

  // Manual flight: as long as something is held.

  manual() {
    for (const button of document.querySelectorAll("[data-fly]")) {
      const name = `${button.dataset.fly}${button.dataset.way}`;
      button.addEventListener("pointerdown", (event) => {
        button.setPointerCapture(event.pointerId);
        this.press(name, button.dataset.fly, Number(button.dataset.way), button);
      });
      for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) button.addEventListener(end, () => this.let(name));
      button.addEventListener("contextmenu", (event) => event.preventDefault());
      button.addEventListener("keydown", (event) => {
        if (event.key === "Enter" && !event.repeat) this.press(name, button.dataset.fly, Number(button.dataset.way), button);
      });
      button.addEventListener("keyup", (event) => event.key === "Enter" && this.let(name));
    }
    addEventListener("blur", () => this.release());
    document.addEventListener("visibilitychange", () => document.hidden && this.release());
    byId("manual").addEventListener("toggle", () => this.release());
  }

  press(name, axis, way, button) {
    if (!this.flies) return;
    button?.classList.add("held");
    this.held.set(name, { axis, way, button });
    this.steer();
    this.steering ??= setInterval(() => this.steer(), REPEAT);
  }

  let(name) {
    const held = this.held.get(name);
    if (!held) return;
    held.button?.classList.remove("held");
    this.held.delete(name);
    if (this.held.size === 0) this.release();
    else this.steer();
  }

  /** Nothing is held any longer, and the drone is told so, unless something else stops it. */
  release(tells = true) {
    const [flew, held] = [this.steering, [...this.held.values()]];
    clearInterval(this.steering);
    this.steering = undefined;
    this.held.clear();
    for (const { button } of held) button?.classList.remove("held");
    if (flew && tells) this.steer();
  }

  steer() {
    const fly = { right: 0, forward: 0, up: 0, turn: 0 };
    for (const { axis, way } of this.held.values()) fly[axis] = Math.max(-1, Math.min(1, fly[axis] + way));
    this.controls.order({ fly }).then((answer) => answer.ok || this.say(answer.text, false));
  }
}
