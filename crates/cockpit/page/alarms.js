// What calls whoever looks away, by sound, vibration and the tab's title, and what keeps the screen on.

/** The gravest first: the title names that one. */
const WORDS = { collision: "COLLISION", page: "CONNECTION LOST", link: "LINK LOST", battery: "LOW BATTERY", picture: "PICTURE OLD" };
/** An alarm that comes and goes calls again after this time, milliseconds. */
const AGAIN = 5000;
/** Beeps: when each begins and how long it is, seconds, and its pitch, Hz. */
const BEEPS = [0, 0.25, 0.5];
const BEEP = 0.15;
const PITCH = 880;

export class Alarms {
  constructor() {
    [this.on, this.called, this.text, this.sound] = [new Set(), new Map(), document.title, null];
    // Browsers make no sound before somebody has touched the page.
    for (const touched of ["pointerdown", "keydown"]) addEventListener(touched, () => this.wake(), { capture: true });
  }

  wake() {
    if (!("AudioContext" in globalThis)) return;
    this.sound ??= new AudioContext();
    if (this.sound.state === "suspended") this.sound.resume().catch(() => {});
  }

  /** The title of the tab while nothing is wrong. */
  title(text) {
    this.text = text;
    this.show();
  }

  /** Tells whether something is wrong. */
  set(name, is) {
    if (is === this.on.has(name)) return;
    if (!is) this.on.delete(name);
    else {
      this.on.add(name);
      // What comes back too soon calls when that time is over, if it is still wrong then.
      const left = (this.called.get(name) ?? -Infinity) + AGAIN - performance.now();
      if (left <= 0) this.call(name);
      else setTimeout(() => this.on.has(name) && this.called.get(name) + AGAIN <= performance.now() && this.call(name), left + 1);
    }
    this.show();
  }

  /** Nothing is wrong any more, as after a flight; but a collision stays. */
  calm() {
    for (const name of [...this.on]) if (name !== "collision") this.set(name, false);
  }

  show() {
    const worst = Object.keys(WORDS).find((name) => this.on.has(name));
    const title = worst ? `⚠ ${WORDS[worst]} – ${this.text}` : this.text;
    if (document.title !== title) document.title = title;
  }

  call(name) {
    this.called.set(name, performance.now());
    if (navigator.userActivation?.hasBeenActive) navigator.vibrate?.([200, 100, 200, 100, 200]);
    if (this.sound?.state !== "running") return;
    for (const after of BEEPS) {
      const [tone, loudness] = [this.sound.createOscillator(), this.sound.createGain()];
      tone.type = "square";
      tone.frequency.value = PITCH;
      loudness.gain.value = 0.15;
      tone.connect(loudness).connect(this.sound.destination);
      tone.start(this.sound.currentTime + after);
      tone.stop(this.sound.currentTime + after + BEEP);
    }
  }
}

/** Keeps the screen on while it is wanted. Browsers let it go when the page is hidden, and it is asked for again. */
export class Awake {
  constructor() {
    [this.wanted, this.lock] = [false, null];
    document.addEventListener("visibilitychange", () => this.hold());
  }

  set(wanted) {
    if (wanted === this.wanted) return;
    this.wanted = wanted;
    this.hold();
  }

  async hold() {
    if (!this.wanted) {
      this.lock?.release();
      this.lock = null;
    } else if (!this.lock && !this.asking && !document.hidden && navigator.wakeLock) {
      this.asking = true;
      // Refused where the battery is low: the flight goes on all the same.
      const lock = await navigator.wakeLock.request("screen").catch(() => null);
      this.asking = false;
      this.lock = lock;
      lock?.addEventListener("release", () => (this.lock = this.lock === lock ? null : this.lock));
      if (!this.wanted) this.hold();
    }
  }
}
