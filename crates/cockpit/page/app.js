// The cockpit: joins what is seen and what is ordered.

import { Alarms, Awake } from "./alarms.js";
import { Decisions } from "./decisions.js";
import { caption } from "./draw.js";
import { Film } from "./film.js";
import { Orders } from "./fly.js";
import { byId, clock, element, metres, open } from "./look.js";
import { MapView } from "./map.js";
import { Marks } from "./mark.js";
import { Picture } from "./picture.js";
import { Controls, Watch } from "./sockets.js";

let watch;
const picture = new Picture(() => watch?.confirm());
const film = new Film(
  (head, frame, arrived) => picture.frame(head, frame, arrived),
  () => watch?.confirm(),
  () => watch?.format("jpeg"),
);
const map = new MapView();
const decisions = new Decisions((query) => watch?.open(query));
const [alarms, awake] = [new Alarms(), new Awake()];
picture.aged = (old) => alarms.set("picture", old);
const controls = new Controls({ message: role, welcome, lost, late });
const orders = new Orders(controls, picture);
orders.marks = new Marks(orders, picture);
const body = document.body;

/**
 * A new tab knows nothing of this one. It asks for the right to replay and delete flights, by a number that is good for once and for
 * a few seconds: what flies is in no address, and so in no history.
 */
for (const id of ["past", "ended-flights"]) {
  byId(id).addEventListener("click", (event) => {
    if (!controls.session || !("BroadcastChannel" in globalThis)) return;
    event.preventDefault();
    const ask = Array.from(crypto.getRandomValues(new Uint8Array(16)), (byte) => byte.toString(16).padStart(2, "0")).join("");
    const channel = new BroadcastChannel("flights");
    channel.onmessage = ({ data }) => {
      if (data.ask !== ask) return;
      channel.postMessage({ asked: ask, key: controls.session });
      // What is posted is lost if it is closed at once.
      channel.onmessage = null;
    };
    setTimeout(() => channel.close(), 10000);
    window.open(`/flights#ask=${ask}`, "_blank", "noopener");
  });
}

/** Who this page is. Recorded flights are shown on the program's own machine only. */
function welcome({ flights }) {
  if (flights !== undefined) for (const id of ["past", "ended-flights"]) byId(id).hidden = !flights;
  see();
}

/** Opens the other connection, once it is known who this page is. */
function see() {
  if (watch) return watch.connection.again();
  const greeted = () => {
    film.restart();
    if (film.wanted) watch.format("film");
  };
  watch = new Watch({ message, picture: binary, greeted });
}

function binary(data) {
  const length = new DataView(data).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
  const body = new Uint8Array(data, 4 + length);
  if (head.query !== undefined) decisions.picture(head, body);
  else if (head.key !== undefined) film.decode(head, body);
  // Sent before the film was asked for: nobody waits for its confirmation.
  else if (!film.wanted || !watch.filming) picture.show(head, body);
}

/** Whether the program has ended. */
let gone = false;

function lost(is, over, reason) {
  const alarm = byId("alarm");
  alarm.hidden = !is;
  const flying = body.dataset.flight === "on";
  alarms.set("page", is && flying);
  if (!is) return;
  orders.release();
  orders.cut.drop("the connection is lost");
  // What was true a moment ago may not be now.
  if (!over && flying) for (const id of ["link", "speed"]) [byId(id).textContent, byId(id).className] = ["?", "bad"];
  alarm.textContent = over
    ? (reason || "The program has ended.")
    : `Connection lost. ${flying ? "The drone goes on landing or returning; else it holds if only this page controls it, and lands after 20 s. " : ""}Trying again …`;
  if (over && byId("ended").open) alarm.hidden = true;
  if (!over || gone) return;
  gone = true;
  // Nobody serves them any longer.
  for (const id of ["past", "ended-flights"]) byId(id).hidden = true;
  byId("ended-lines").append(element("p", "The program has ended. “spf cockpit --view flights” shows its flights."));
}

/** The answer to an order that counted as not confirmed. */
function late({ ok, text }) {
  orders.say(ok ? `An order that was not confirmed was received after all${text ? `: ${text}` : "."}` : text, ok);
}

/** For how long the page that flies was lost, seconds, if the drone is to hold because of that, and whether it was seen to: the news
 * and the drone's state come by two ways, and a state from before the news says nothing. */
let away = null;
let awayHeld = false;

/** Asks what to do after the drone has held because this page was lost. */
function heldBecauseLost(state) {
  const holds = state.phase === "held" || state.will_hold;
  if (!holds && awayHeld) away = null;
  awayHeld = away !== null && (holds || awayHeld);
  const text = away === null ? "" : `Held: link lost ${Math.max(1, Math.round(away))} s.`;
  show("held-text", text);
  byId("held").hidden = away === null || state.phase !== "held";
}

/** The page that asks this one for the controls. */
let asked = null;

function role(message) {
  if (message.type === "refused") {
    byId("alarm").hidden = false;
    byId("alarm").textContent = message.why;
    picture.clear("");
    return;
  }
  if (message.type === "held") {
    [away, awayHeld] = [message.away, false];
    return;
  }
  if (message.type !== "role") return message.text && orders.say(message.text, false);
  if ((body.dataset.role === "pilot") !== message.pilot) byId("ack").textContent = "";
  body.dataset.role = message.pilot ? "pilot" : "spectator";
  if (!message.pilot) orders.cut.drop("the controls are not here");
  keepAwake();
  const others = message.pages - 1;
  byId("role").textContent = message.pilot ? (others ? `You fly · ${others} more here` : "You fly") : "Watching";
  byId("ask").hidden = message.pilot;
  byId("ask").disabled = message.asking;
  byId("ask").textContent = message.asking ? "Asked …" : message.someone ? "Ask for the controls" : "Take the controls";
  byId("assistant").hidden = !message.arms;
  // What is answered is about the page that was shown to ask.
  if (message.asked !== asked) byId("handover").close();
  asked = message.asked;
  if (asked !== null) open(byId("handover"));
  orders.arms();
}

const handlers = {
  flight(flight) {
    body.dataset.flight = "on";
    alarms.set("collision", false);
    away = null;
    keepAwake();
    for (const part of [map, decisions]) part.clear();
    [map.outlines, map.fence] = [flight.outlines, flight.fence];
    problems = [];
    [orders.human, orders.steps] = [flight.vlm === "human", flight.steps];
    byId("point").hidden = orders.human;
    byId("point").disabled = !flight.points;
    byId("answers").hidden = !orders.human;
    byId("instruction").placeholder = "Change the instruction";
    byId("send").textContent = "Change";
    byId("ended").close();
    picture.clear("Waiting for the first picture …");
    question({});
    instruction(flight.instruction);
    orders.arms();
    map.draw();
  },
  path: ({ path }) => (map.path = path),
  offset: ({ offset }) => (map.offset = offset),
  obstacles: ({ cells }) => (map.cells = cells),
  line(line) {
    if (line.recording) problems.push(line.text);
    decisions.line(line);
  },
  decision(decision) {
    decisions.decision(decision);
    map.decisions.push(decision.at);
    byId("step").textContent = decision.text;
  },
  question,
  waiting({ about }) {
    body.dataset.flight = "none";
    keepAwake();
    byId("send").textContent = "Fly";
    byId("instruction").placeholder = "Say what the drone should do";
    picture.clear(`Ready: ${about}. What should the drone do?`);
    byId("phase").textContent = "ready";
    byId("step").textContent = "";
    if (body.dataset.role === "pilot" && !byId("ended").open) byId("instruction").focus();
  },
  assistant({ about }) {
    body.dataset.flight = "none";
    keepAwake();
    byId("send").textContent = "Change";
    picture.clear(`An assistant flies here: ${about}.`);
    byId("phase").textContent = "ready";
    byId("step").textContent = "";
  },
  state,
  opened: (message) => decisions.detail(message),
  end({ outcome, result, t, flown, incomplete }) {
    body.dataset.flight = "over";
    keepAwake();
    byId("phase").textContent = outcome;
    byId("step").textContent = "";
    question({});
    // From here on the figures are those of the result.
    over();
    text("time", clock(t));
    text("flown", metres(flown));
    const missing = incomplete && problems.length === 0 ? ["The recording of this flight is not complete."] : problems;
    byId("ended-lines").replaceChildren(
      ...result.map((line) => element("p", line)),
      element("p", `Flight time until then: ${clock(t)}.`, { class: "faint" }),
      ...missing.map((line) => element("p", line, { class: "problem" })),
    );
    open(byId("ended"));
  },
};

function message(message) {
  handlers[message.type]?.(message);
}

/** The query that waits for a person. */
function question({ query, confirm }) {
  byId("question").hidden = query === undefined;
  if (query === undefined) return;
  byId("question-text").textContent = confirm
    ? "You said that we are there. Look again: confirm, or point."
    : "Click in the picture.";
}

function instruction(text) {
  alarms.title(`${text} – SPF cockpit`);
  byId("reading").textContent = `Instruction: ${text}`;
  byId("reading").className = "";
}

/** What a screen reader says of the picture; set only if it differs. */
function label(text) {
  if (byId("picture").getAttribute("aria-label") !== text) byId("picture").setAttribute("aria-label", text);
}

/** Changes a text only if it differs: screen readers say what changes. */
function show(id, text) {
  if (byId(id).textContent !== text) byId(id).textContent = text;
}

let said = "";

/** What could not be recorded of this flight, as told to who flies. */
let problems = [];

function text(id, value, kind = "") {
  byId(id).textContent = value;
  byId(id).className = kind;
}

/** A drone that has landed is no longer heard of, and that is nothing to worry about. */
function over() {
  for (const id of ["link", "speed"]) text(id, "–");
  byId("held").hidden = true;
  orders.cut.drop();
  picture.age();
  alarms.calm();
}

/** The screen stays on while this page flies. */
function keepAwake() {
  awake.set(body.dataset.role === "pilot" && body.dataset.flight === "on");
}

function state(state) {
  body.dataset.flight = "on";
  keepAwake();
  const phases = { ground: "on the ground", take_off: "taking off", flying: "flying", held: "held", manual: "by hand", hovering: "hovering", returning: "returning home", landing: "landing", ended: "ended" };
  show("phase", (phases[state.phase] ?? state.phase) + (state.will_hold ? ", will hold" : ""));
  byId("resume").hidden = !["held", "manual"].includes(state.phase) && !state.will_hold;
  if (state.instruction !== said) instruction((said = state.instruction));
  text("height", metres(state.height));
  text("speed", state.speed === null ? "–" : `${state.speed.toFixed(1)} m/s`);
  text("battery", state.battery === null ? "–" : `${Math.round(100 * state.battery)} %`, state.battery !== null && state.battery < 0.2 ? "bad" : "");
  text("link", state.link ? "good" : "LOST", state.link ? "" : "bad");
  const live = state.phase !== "ended";
  alarms.set("link", live && !state.link);
  alarms.set("battery", live && state.battery !== null && state.battery < 0.2);
  alarms.set("collision", state.crashed);
  heldBecauseLost(state);
  text("heading", `${String(Math.round(state.heading) % 360).padStart(3, "0")}°`);
  text("flown", metres(state.flown));
  text("time", clock(state.t));
  const seen = picture.head?.overlay?.point;
  label(`Live picture: ${byId("phase").textContent}${seen ? `, ${seen.label && !seen.target ? `to ${seen.label}, ` : ""}${caption(seen)} away` : ""}`);
  orders.marks.list(state.marked);
  map.fly(state);
  if (state.phase !== "ended") return;
  over();
  show("step", "The flight is over. Its recording is being finished …");
}

byId("say").onsubmit = async (event) => {
  event.preventDefault();
  const box = byId("instruction");
  const text = box.value.trim();
  if (!text) return;
  const answer = await controls.order({ instruction: text });
  byId("reading").className = answer.ok ? "" : "no";
  byId("reading").textContent = answer.ok ? `${text}${answer.text ? ` — ${answer.text}` : ""}` : answer.text;
  if (answer.ok) {
    said = text;
    remember(text);
    box.value = "";
    box.blur();
  }
};

/** Earlier instructions, by the arrow keys in the box. */
const earlier = [];
let at = 0;
function remember(text) {
  earlier.push(text);
  at = earlier.length;
}
byId("instruction").addEventListener("keydown", (event) => {
  const step = { ArrowUp: -1, ArrowDown: 1 }[event.key];
  if (!step || earlier.length === 0) return;
  event.preventDefault();
  at = Math.max(0, Math.min(earlier.length, at + step));
  event.target.value = earlier[at] ?? "";
});

byId("arm").onclick = () => orders.give({ assistant: 10 });
byId("disarm").onclick = () => orders.give({ assistant: 0 });
byId("ask").onclick = () => orders.give("ask");
byId("give").onclick = () => orders.give({ give: { page: asked, yes: true } });
byId("keep").onclick = () => orders.give({ give: { page: asked, yes: false } });
byId("ended-close").onclick = () => byId("ended").close();
