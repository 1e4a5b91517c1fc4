// Small things that several modules share.

export const byId = (id) => document.getElementById(id);

/** Metres of the depth labels 1 to 10, as in the prompt. */
export const METRES = Array.from({ length: 10 }, (_, i) => 10 ** (i / 4.5));

export function metres(value, digits = 1) {
  // Not "-0.0".
  return value === null || value === undefined ? "–" : `${value.toFixed(digits).replace(/^-(0(\.0*)?)$/, "$1")} m`;
}

/** A distance for a person: no more digits than a depth label is worth. */
export function roughly(value) {
  return value < 3 ? `${value.toFixed(1)} m` : `${Math.round(value)} m`;
}

export function clock(seconds) {
  if (seconds === null || seconds === undefined) return "–";
  const whole = Math.floor(seconds);
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}

/** An element with text and attributes; text is never read as HTML. */
export function element(name, text = "", attributes = {}) {
  const made = document.createElement(name);
  made.textContent = text;
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
}

export function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

/** The drawing context of a canvas at the resolution of the screen, in CSS pixels. */
export function sharp(canvas) {
  const { width, height } = canvas.getBoundingClientRect();
  const scale = devicePixelRatio || 1;
  const [w, h] = [Math.round(width * scale), Math.round(height * scale)];
  if (canvas.width !== w || canvas.height !== h) [canvas.width, canvas.height] = [w, h];
  const context = canvas.getContext("2d");
  context.setTransform(scale, 0, 0, scale, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height };
}

/** Opens a window that leaves the stop buttons usable, and gives the focus back when it closes. */
export function open(dialog) {
  if (dialog.open) return;
  const before = document.activeElement;
  dialog.show();
  (dialog.querySelector("button") ?? dialog).focus();
  dialog.addEventListener("close", () => before?.focus?.(), { once: true });
}

/** Whether keys are text at the moment. */
export function isTyping(target) {
  return target instanceof HTMLInputElement && !["range", "checkbox", "button"].includes(target.type)
    || target instanceof HTMLTextAreaElement;
}
