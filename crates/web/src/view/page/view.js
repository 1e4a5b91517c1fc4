"use strict";

const $ = (id) => document.getElementById(id);
const picture = $("picture");
const paint = picture.getContext("2d", { alpha: false });

/** Key code → axis and direction. */
const KEYS = {
  KeyW: ["forward", 1], ArrowUp: ["forward", 1], KeyS: ["forward", -1], ArrowDown: ["forward", -1],
  KeyD: ["right", 1], ArrowRight: ["right", 1], KeyA: ["right", -1], ArrowLeft: ["right", -1],
  KeyE: ["yaw", 1], KeyQ: ["yaw", -1], KeyR: ["up", 1], KeyF: ["up", -1], KeyT: ["pitch", 1], KeyG: ["pitch", -1],
};
/** Keys hold half a second at the server; said this often, ms. */
const REPEAT = 150;
/** Horizontal field of view that a drag over the whole picture turns by, degrees. */
const DRAG_DEG = 90;

let socket = null;
let retry = 500;
let head = null;
let scene = "";
let tellTimer = 0;
const held = new Set();
let fast = false;

// ---------------------------------------------------------------- connection

function say(message) {
  if (socket && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
}

function connect() {
  socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/socket`);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => {
    retry = 500;
    announce("");
    // A browser keeps selected values when a page is reloaded; the server does not.
    say({ type: "channel", channel: channel() });
    say({ type: "detail", detail: $("detail").value });
    say({ type: "collide", on: $("collide").checked });
    tellRun();
  };
  socket.onmessage = ({ data }) => (typeof data === "string" ? listen(JSON.parse(data)) : receive(data));
  socket.onclose = ({ reason }) => {
    letGo();
    announce(reason ? `${reason[0].toUpperCase()}${reason.slice(1)}.` : "Connection lost, reconnecting…");
    setTimeout(connect, retry);
    retry = Math.min(retry * 2, 8000);
  };
}

function announce(text) {
  $("message").textContent = text;
  $("message").hidden = !text;
}

function listen(message) {
  if (message.type === "hello") {
    for (const [list, names] of [["scene", message.scenes], ["light", message.lights], ["weather", message.weathers]]) {
      $(list).replaceChildren(...names.map((name) => new Option(name, name)));
    }
  } else if (message.type === "loading") {
    announce(`Loading ${message.name}…`);
  } else if (message.type === "scene") {
    scene = message.name;
    announce("");
    $("scene").value = message.name;
    for (const list of ["craft", "light", "weather"]) $(list).value = message[list];
    $("scene-title").textContent = message.title;
    $("scene-text").textContent = message.description;
    $("running").hidden = message.actors === 0;
    $("scene-facts").textContent = `${message.objects} objects, ${message.triangles.toLocaleString("en")} triangles`;
    document.title = `${message.title} – spf sim view`;
  } else if (message.type === "under") {
    showUnder(message.under);
  } else if (message.type === "refused") {
    announce(message.reason);
    setTimeout(() => announce(""), 4000);
  }
}

// ---------------------------------------------------------------- pictures

const shown = [];

async function receive(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const next = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  try {
    const image = await createImageBitmap(new Blob([new Uint8Array(buffer, 4 + length)], { type: "image/jpeg" }));
    // Images may be decoded out of order: an older one is not shown after a newer one.
    if (!head || next.frame > head.frame || next.frame === 1) show(next, image);
    image.close();
  } finally {
    say({ type: "shown", frame: next.frame });
  }
  count(buffer.byteLength);
}

function show(next, image) {
  head = next;
  if (picture.width !== image.width || picture.height !== image.height) {
    picture.width = image.width;
    picture.height = image.height;
    document.documentElement.style.setProperty("--aspect", `${image.width} / ${image.height}`);
  }
  paint.drawImage(image, 0, 0);
  picture.dataset.frame = head.frame;
  const metres = (value) => `${value.toFixed(1)} m`;
  $("east").textContent = metres(head.east);
  $("north").textContent = metres(head.north);
  $("up").textContent = metres(head.up);
  $("heading").textContent = `${head.heading_deg.toFixed(0).padStart(3, "0")}°`;
  $("pitch").textContent = `${head.pitch_deg.toFixed(0)}°`;
  $("speed").textContent = `${head.speed_m_s.toFixed(1)} m/s`;
  $("touching").hidden = !head.touching;
  $("touching").textContent = head.touching ? `collision with ${head.touching}` : "";
  drawCompass(head.heading_deg);
  showUnder(head.under);
}

function count(bytes) {
  const now = performance.now();
  shown.push([now, bytes]);
  while (shown[0][0] < now - 1000) shown.shift();
  const rate = shown.reduce((sum, [, size]) => sum + size, 0);
  const pace = shown.length > 1 ? `${shown.length} frames/s, ${(rate / 1e6).toFixed(1)} MB/s\n` : "";
  $("figures").textContent = `${pace}${head.width}×${head.height}\nrendered in ${head.draw_ms.toFixed(0)} ms\nencoded in ${head.encode_ms.toFixed(0)} ms`;
}

function drawCompass(heading) {
  const compass = $("compass");
  const pen = compass.getContext("2d");
  const { width, height } = compass;
  const perDegree = width / 120;
  pen.clearRect(0, 0, width, height);
  pen.textAlign = "center";
  for (let step = Math.ceil((heading - 60) / 5) * 5; step <= heading + 60; step += 5) {
    const x = width / 2 + (step - heading) * perDegree;
    const bearing = ((step % 360) + 360) % 360;
    const name = { 0: "N", 45: "NE", 90: "E", 135: "SE", 180: "S", 225: "SW", 270: "W", 315: "NW" }[bearing];
    pen.globalAlpha = 1 - Math.abs(step - heading) / 66;
    pen.fillStyle = name ? "#ffffff" : "#98a1b2";
    pen.fillRect(x - 1, 0, 2, name ? 14 : bearing % 15 === 0 ? 10 : 6);
    if (name || bearing % 15 === 0) {
      pen.font = name ? "600 22px system-ui, sans-serif" : "16px system-ui, sans-serif";
      pen.fillText(name ?? bearing, x, 38);
    }
  }
  pen.globalAlpha = 1;
  pen.fillStyle = "#ffc400";
  pen.fillRect(width / 2 - 1.5, 0, 3, 18);
}

// ---------------------------------------------------------------- what is under the pointer

let pointer = null;
let pointerDue = false;

function showUnder(under) {
  $("under").hidden = !under || !pointer || dragging !== null;
  if (!under || !pointer) return;
  $("under-words").textContent = under.words;
  $("under-distance").textContent = under.distance_m < 10 ? `${under.distance_m.toFixed(1)} m` : `${under.distance_m.toFixed(0)} m`;
  $("under-kind").textContent = `${under.kind} · ${under.key}${under.through ? ` · through ${under.through}` : ""}`;
  $("under-tags").textContent = under.tags.join(", ");
  const box = $("under").getBoundingClientRect();
  const left = pointer.x + 18 + box.width > innerWidth ? pointer.x - 14 - box.width : pointer.x + 18;
  const top = Math.min(pointer.y + 16, innerHeight - box.height - 8);
  $("under").style.transform = `translate(${Math.max(4, left)}px, ${Math.max(4, top)}px)`;
}

function tellPointer() {
  if (pointerDue) return;
  pointerDue = true;
  requestAnimationFrame(() => {
    pointerDue = false;
    const box = picture.getBoundingClientRect();
    const share = (value) => Math.min(1, Math.max(0, value));
    const at = pointer && [share((pointer.x - box.left) / box.width), share((pointer.y - box.top) / box.height)];
    say({ type: "point", at });
  });
}

function movePointer(event) {
  pointer = event && { x: event.clientX, y: event.clientY };
  tellPointer();
  if (!pointer) $("under").hidden = true;
}

// ---------------------------------------------------------------- looking by dragging

let dragging = null;
let turned = { yaw: 0, pitch: 0 };

picture.addEventListener("pointerdown", (event) => {
  picture.focus();
  picture.setPointerCapture(event.pointerId);
  picture.classList.add("dragging");
  dragging = { x: event.clientX, y: event.clientY };
});
picture.addEventListener("pointermove", (event) => {
  if (dragging) {
    const scale = DRAG_DEG / picture.getBoundingClientRect().width;
    const idle = turned.yaw === 0 && turned.pitch === 0;
    turned.yaw += (event.clientX - dragging.x) * scale;
    turned.pitch -= (event.clientY - dragging.y) * scale;
    dragging = { x: event.clientX, y: event.clientY };
    if (idle) requestAnimationFrame(tellTurn);
  }
  movePointer(event);
});
function tellTurn() {
  const limit = (value, most) => Math.min(most, Math.max(-most, value));
  say({ type: "turn", yaw_deg: limit(turned.yaw, 360), pitch_deg: limit(turned.pitch, 180) });
  turned = { yaw: 0, pitch: 0 };
}
for (const end of ["pointerup", "pointercancel"]) {
  picture.addEventListener(end, () => { dragging = null; picture.classList.remove("dragging"); });
}
picture.addEventListener("pointerleave", () => { if (!dragging) movePointer(null); });

// ---------------------------------------------------------------- keys

function tellKeys() {
  const push = { right: 0, forward: 0, up: 0, yaw: 0, pitch: 0 };
  for (const code of held) push[KEYS[code][0]] += KEYS[code][1];
  for (const axis in push) push[axis] = Math.min(1, Math.max(-1, push[axis]));
  say({ type: "fly", ...push, fast });
  clearTimeout(tellTimer);
  if (held.size) tellTimer = setTimeout(tellKeys, REPEAT);
}

function letGo() {
  held.clear();
  fast = false;
  tellKeys();
}

const ACTIONS = {
  Digit1: () => setChannel("colour"), Digit2: () => setChannel("ids"), Digit3: () => setChannel("depth"),
  Digit0: () => say({ type: "go", pose: null }), KeyP: () => copyPose("--pose"), KeyH: () => document.body.classList.toggle("bare"),
};

addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target instanceof HTMLSelectElement) return;
  fast = event.shiftKey;
  if (KEYS[event.code]) {
    event.preventDefault();
    if (!event.repeat) held.add(event.code);
    if (!event.repeat) tellKeys();
  } else if (ACTIONS[event.code] && !event.repeat) {
    event.preventDefault();
    ACTIONS[event.code]();
  } else if (event.key === "Shift" && held.size) {
    tellKeys();
  }
});
addEventListener("keyup", (event) => {
  fast = event.shiftKey;
  if (held.delete(event.code) || event.key === "Shift") tellKeys();
});
addEventListener("blur", letGo);
// A hidden page needs no motion and no images.
document.addEventListener("visibilitychange", () => { letGo(); tellRun(); });

function tellRun() {
  say({ type: "run", on: $("run").checked && !document.hidden });
}

// ---------------------------------------------------------------- controls

function channel() {
  return document.querySelector("#channels [aria-checked=true]").dataset.channel;
}

function setChannel(name) {
  for (const button of $("channels").children) button.setAttribute("aria-checked", button.dataset.channel === name);
  $("depth-legend").hidden = name !== "depth";
  say({ type: "channel", channel: name });
}

function copyPose(flag) {
  if (!head) return;
  const numbers = [head.east, head.north, head.up].map((value) => value.toFixed(2));
  numbers.push(head.heading_deg.toFixed(1));
  // A craft starts level, so the pitch of this camera is not part of a start pose.
  if (flag === "--pose") numbers.push(head.pitch_deg.toFixed(1));
  const text = `${flag} ${numbers.map((value) => value.replace(/^-0(\.0+)?$/, "0")).join(",")}`;
  const told = (ok) => { $("copied").textContent = ok ? `Copied: ${text}` : text; };
  if (navigator.clipboard) navigator.clipboard.writeText(text).then(() => told(true), () => told(false));
  else told(false);
}

for (const button of $("channels").children) button.addEventListener("click", () => setChannel(button.dataset.channel));
$("scene").addEventListener("change", (event) => { say({ type: "scene", name: event.target.value }); picture.focus(); });
for (const list of ["light", "weather"]) {
  $(list).addEventListener("change", () => {
    say({ type: "conditions", light: $("light").value, weather: $("weather").value });
    picture.focus();
  });
}
$("craft").addEventListener("change", (event) => { say({ type: "craft", craft: event.target.value }); picture.focus(); });
$("detail").addEventListener("change", (event) => { say({ type: "detail", detail: event.target.value }); picture.focus(); });
$("collide").addEventListener("change", (event) => { say({ type: "collide", on: event.target.checked }); picture.focus(); });
$("run").addEventListener("change", () => { tellRun(); picture.focus(); });
$("home").addEventListener("click", () => { say({ type: "go", pose: null }); picture.focus(); });
$("copy-pose").addEventListener("click", () => { copyPose("--pose"); picture.focus(); });
$("copy-start").addEventListener("click", () => { copyPose("--start"); picture.focus(); });

picture.focus();
connect();
