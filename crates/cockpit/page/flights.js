// Recorded flights: the list, and one of them with film and decisions in step.

import { byId, clock, element, metres } from "./look.js";

/** What gives the right to replay and delete: from the address that the program printed, or from the cockpit's tab that opened this one. Kept for this tab only. */
async function takeKey() {
  const [, way, given] = location.hash.match(/^#(key|ask)=([0-9a-f]+)$/) ?? [];
  if (!way) return;
  history.replaceState(null, "", location.pathname);
  const key = way === "key" ? given : await asked(given);
  if (key) sessionStorage.setItem("key", key);
}

/** The key from the tab that opened this one; undefined if it does not answer. */
function asked(ask) {
  const channel = new BroadcastChannel("flights");
  return new Promise((resolve) => {
    channel.onmessage = ({ data }) => data.asked === ask && resolve(data.key);
    channel.postMessage({ ask });
    setTimeout(resolve, 1000);
  }).finally(() => channel.close());
}

const bearer = () => ({ authorization: `Bearer ${sessionStorage.getItem("key")}` });

const file = (name, which) => `/flight/${encodeURIComponent(name)}/${which}`;

async function start() {
  await takeKey();
  const answer = await fetch("/flights.json");
  if (!answer.ok) {
    byId("told").textContent = (await answer.text()).trim();
    return;
  }
  const { flights, report } = await answer.json();
  byId("report").hidden = !report;
  const wanted = decodeURIComponent(location.hash.slice(1));
  const flight = flights.find(({ name }) => name === wanted);
  for (const id of ["cards", "flight"]) byId(id).hidden = (id === "flight") !== Boolean(flight);
  byId("back").hidden = !flight;
  byId("told").textContent = told || (flights.length ? "" : "No flights are recorded here yet.");
  told = "";
  if (flight) await show(flight);
  else list(flights);
}

/** All instructions of a flight, in order; the first one names it. */
const instructions = (flight) => [...(flight.earlier_instructions ?? []), flight.instruction ?? flight.name];

function outcome({ outcome, verified }) {
  const words = String(outcome ?? "unfinished").replaceAll("_", " ");
  return verified === true ? `${words}, verified` : verified === false && outcome === "reached" ? `${words}, NOT verified` : words;
}

function kind(flight) {
  return flight.outcome === "reached" && flight.verified !== false ? "reached" : "other";
}

function list(flights) {
  document.title = "Flights – SPF cockpit";
  byId("title").textContent = `Flights (${flights.length})`;
  const looks = new IntersectionObserver((entries) => {
    for (const { isIntersecting, target } of entries) {
      if (!isIntersecting || target.src) continue;
      // Its last second shows what was reached.
      target.src = `${file(target.dataset.name, "video.mp4")}#t=${Math.max(0.1, Number(target.dataset.until) - 1).toFixed(1)}`;
    }
  });
  const cards = flights.map((flight) => {
    const card = element("button", "", { type: "button", class: "card" });
    const picture = flight.film
      ? element("video", "", { muted: "", playsinline: "", preload: "metadata", "data-name": flight.name, "data-until": flight.time ?? 1, "aria-hidden": "true", tabindex: "-1" })
      : flight.map
        ? element("img", "", { src: file(flight.name, "trajectory.svg"), alt: "", loading: "lazy" })
        : element("span", "no film", { class: "blank" });
    if (flight.film) looks.observe(picture);
    const text = element("div");
    const [first, ...later] = instructions(flight);
    const facts = [clock(flight.time), metres(flight.flown), `${flight.decisions ?? 0} decisions`].join(" · ");
    text.append(
      element("strong", first),
      ...later.map((text) => element("span", `then: ${text}`, { class: "later" })),
      element("span", outcome(flight), { class: `outcome ${kind(flight)}` }),
      element("span", facts, { class: "faint" }),
      element("span", `${flight.scene || flight.drone || ""} · ${flight.vlm ?? ""} · ${new Date(1000 * flight.written).toLocaleString()}`, { class: "faint" }),
    );
    card.append(picture, text);
    card.onclick = () => (location.hash = encodeURIComponent(flight.name));
    const item = element("li");
    item.append(card);
    return item;
  });
  byId("cards").replaceChildren(...cards);
}

async function show(flight) {
  const title = instructions(flight).join(" → ");
  document.title = `${title} – SPF cockpit`;
  byId("title").textContent = title;
  byId("outcome").textContent = outcome(flight);
  byId("outcome").className = `outcome ${kind(flight)}`;
  byId("cause").textContent = flight.cause ?? "";
  const facts = [
    ["flight time", clock(flight.time)], ["from first motion", flight.since_motion === null ? "–" : `${flight.since_motion.toFixed(1)} s`],
    ["flown", metres(flight.flown)], ["decisions", flight.decisions],
    ["from the target", metres(flight.distance)], ["collisions", flight.collisions ?? "unknown"], ["scene", flight.scene || "–"], ["VLM", flight.vlm],
    ...(flight.not_recorded?.length ? [["not recorded completely", flight.not_recorded.join(", ")]] : []),
  ];
  byId("facts").replaceChildren(...facts.flatMap(([name, value]) => [element("dt", name), element("dd", String(value ?? "–"))]));
  const film = byId("film");
  film.hidden = !flight.film;
  byId("no-film").hidden = flight.film;
  if (flight.film) film.src = file(flight.name, "video.mp4");
  else film.removeAttribute("src");
  byId("map-panel").hidden = !flight.map;
  if (flight.map) byId("map-image").src = file(flight.name, "trajectory.svg");
  const files = [["video.mp4", "Film", flight.film], ["flight.mcap", "Flight log", flight.log], ["decisions.jsonl", "Decisions", true], ["queries.jsonl", "Queries", true], ["summary.json", "Summary", true]];
  byId("files").replaceChildren(...files.filter(([, , there]) => there).map(([name, text]) => element("a", `↓ ${text}`, { class: "plain", href: file(flight.name, name), download: `${flight.name}-${name}` })));
  byId("detail").hidden = true;
  byId("again").hidden = !flight.log || !sessionStorage.getItem("key");
  byId("differences").hidden = true;
  byId("replayed").textContent = byId("removed").textContent = "";
  byId("replay").onclick = () => again(flight);
  byId("removal").hidden = !sessionStorage.getItem("key");
  byId("delete").onclick = () => ask(flight);
  await steps(flight, film);
}

/** Replays it on the server, and shows what differs. */
async function again({ name }) {
  byId("replay").disabled = true;
  byId("replayed").textContent = "Replaying …";
  let report;
  try {
    const answer = await fetch(`/again/${encodeURIComponent(name)}`, { method: "POST", headers: bearer() });
    if (!answer.ok) return (byId("replayed").textContent = (await answer.text()).trim());
    report = await answer.json();
  } catch (error) {
    return (byId("replayed").textContent = `Not replayed: ${error.message}`);
  } finally {
    byId("replay").disabled = false;
  }
  const { inputs, outputs, torn, differences, told } = report;
  const end = torn ? " The log has no end: it was replayed as far as it goes." : "";
  byId("replayed").textContent = differences
    ? `${differences} of ${outputs} outputs differ, after ${inputs} inputs.${end}${told.length < differences ? ` The first ${told.length}:` : ""}`
    : `No difference: ${inputs} inputs replayed, ${outputs} identical outputs.${end}`;
  byId("differences").hidden = told.length === 0;
  byId("differences").replaceChildren(...told.map(({ t, topic, at, recorded, replayed, more }) => {
    const item = element("li");
    item.append(
      element("time", `${t.toFixed(2)} s `), element("b", `${topic} ${at}`),
      element("div", `then: ${recorded ?? "nothing"}`), element("div", `now: ${replayed ?? "nothing"}`),
      more ? element("div", `and ${more} more fields`, { class: "faint" }) : "",
    );
    return item;
  }));
}

/** Deletes it, if somebody is sure. */
function ask(flight) {
  const { name } = flight;
  const title = instructions(flight).join(" → ");
  byId("sure-text").textContent = `“${title}”: its film, log and decisions are gone then, for good.`;
  byId("sure-no").onclick = () => byId("sure").close();
  byId("sure-yes").onclick = async () => {
    byId("sure").close();
    const answer = await fetch(`/flight/${encodeURIComponent(name)}`, {
      method: "DELETE", headers: bearer(),
    });
    const text = (await answer.text()).trim();
    if (!answer.ok) return (byId("removed").textContent = text);
    location.hash = "";
    told = `${title}: ${text}.`;
  };
  byId("sure").showModal();
}

let told = "";

async function steps(flight, film) {
  const [rows, queries] = await Promise.all(["decisions.jsonl", "queries.jsonl"].map((name) => lines(flight, name)));
  const prompts = new Map(queries.map((query) => [query.id, query.prompt]));
  const buttons = rows.map((row) => {
    const button = element("button", "", { type: "button" });
    button.append(element("b", `${row.number}. `), element("time", `${clock(row.answered_s)} `), said(row));
    button.onclick = () => {
      // Its caption is in the next image of the film, of ten a second.
      if (flight.film) film.currentTime = row.answered_s + 0.15;
      mark(row);
      detail(row, prompts.get(row.query?.id));
    };
    return button;
  });
  byId("steps").replaceChildren(...buttons.map((button) => {
    const item = element("li");
    item.append(button);
    return item;
  }));
  const mark = (row) => buttons.forEach((button, i) => button.setAttribute("aria-current", String(rows[i] === row)));
  // The film runs in flight time.
  film.ontimeupdate = () => {
    const now = rows.findLast((row) => row.answered_s <= film.currentTime + 0.05);
    mark(now);
  };
}

/** The rows of a file of JSON lines; none if there is no such file. */
async function lines(flight, name) {
  const answer = await fetch(file(flight.name, name));
  const text = answer.ok ? await answer.text() : "";
  return text.split("\n").filter(Boolean).map((line) => JSON.parse(line));
}

function said(row) {
  const reply = row.reading?.reply;
  if (row.reading?.refused) return `refused: ${JSON.stringify(row.reading.refused)}`;
  if (!reply) return (row.reading?.actions ?? []).join(", ");
  if (!reply.point) return [reply.status, reply.look].filter(Boolean).join(", ").replaceAll("_", " ");
  const point = reply.point;
  return `${reply.target ?? "target"} at (${point.u.toFixed(2)}, ${point.v.toFixed(2)}), depth label ${reply.depth ?? "–"}`;
}

function detail(row, prompt) {
  const parts = [["Reply", row.reply], ["Prompt", prompt]];
  const shown = parts.filter(([, text]) => text).flatMap(([name, text]) => [element("h2", name), element("pre", text, { tabindex: "0" })]);
  byId("detail").replaceChildren(element("p", `Decision ${row.number}: answered after ${row.latency_s?.toFixed(2)} s, its frame was ${row.frame_age_s?.toFixed(2)} s old.`), ...shown);
  byId("detail").hidden = false;
}

addEventListener("hashchange", start);
start();
