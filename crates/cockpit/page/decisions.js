// The list of decisions and events, and one of them opened.

import { caption, cross, target } from "./draw.js";
import { byId, clock, element, open } from "./look.js";

const ROWS = 400;

export class Decisions {
  constructor(ask) {
    this.list = byId("list");
    this.ask = ask;
    this.rows = new Map();
    byId("close").onclick = () => byId("opened").close();
  }

  clear() {
    this.list.replaceChildren();
    this.rows.clear();
  }

  put(row) {
    const stay = this.list.scrollTop < 20;
    this.list.prepend(row);
    while (this.list.children.length > ROWS) this.list.lastChild.remove();
    if (stay) this.list.scrollTop = 0;
  }

  line({ t, level, text }) {
    const newest = this.list.firstElementChild;
    if (newest?.said === text) {
      newest.times += 1;
      newest.lastElementChild.textContent = ` ×${newest.times}`;
      return;
    }
    const row = element("li", "", { class: `line ${level}` });
    [row.said, row.times] = [text, 1];
    if (t !== undefined) row.append(element("time", clock(t)));
    row.append(text, element("span"));
    this.put(row);
  }

  decision(decision) {
    const row = element("li");
    const button = element("button", "", { type: "button", class: decision.refused ? "warning" : "" });
    button.append(element("time", clock(decision.t)), element("b", `${decision.n}.`), decision.text);
    button.onclick = () => this.open(decision.query);
    row.append(button);
    this.rows.set(decision.query, decision);
    this.put(row);
  }

  open(query) {
    const decision = this.rows.get(query);
    if (!decision) return;
    this.current = query;
    byId("opened-title").textContent = `Decision ${decision.n}`;
    byId("opened-text").textContent = decision.text;
    byId("opened-picture").replaceChildren();
    byId("opened-detail").replaceChildren();
    const facts = [["at", clock(decision.t)], ["answered after", `${decision.latency.toFixed(2)} s`], ["age of its frame", `${decision.age.toFixed(2)} s`], ["next", decision.step]];
    byId("opened-facts").replaceChildren(...facts.flatMap(([name, value]) => [element("dt", name), element("dd", value)]));
    this.ask(query);
    open(byId("opened"));
  }

  /** The rest of what is known of a decision. */
  detail({ query, detail, picture }) {
    if (query !== this.current) return;
    const parts = detail ? [["Instruction", detail.instruction], ["Reply", pretty(detail.reply)], ["What was made of it", JSON.stringify(detail.reading, null, 2)], ["Prompt", detail.prompt]] : [];
    byId("opened-detail").replaceChildren(...parts.filter(([, text]) => text).flatMap(([name, text]) => [element("h3", name), element("pre", text, { tabindex: "0" })]));
    if (!detail) byId("opened-detail").append(element("p", "Prompts and replies are shown to who flies.", { class: "faint" }));
    if (!picture) byId("opened-picture").replaceChildren(element("p", "Its picture is no longer kept.", { class: "faint" }));
  }

  /** Its picture, with the point in it. */
  async picture({ query }, jpeg) {
    if (query !== this.current) return;
    const bitmap = await createImageBitmap(new Blob([jpeg], { type: "image/jpeg" }));
    const canvas = element("canvas", "", { role: "img", "aria-label": "The picture that was sent, with the point" });
    [canvas.width, canvas.height] = [bitmap.width, bitmap.height];
    const c = canvas.getContext("2d");
    c.drawImage(bitmap, 0, 0);
    const { point, flown_to: to } = this.rows.get(query) ?? {};
    if (point) cross(c, point[0] * canvas.width, point[1] * canvas.height, "#ffffff");
    // The same as in the live picture, as seen from here.
    if (to) target(c, to.u * canvas.width, to.v * canvas.height, caption(to), { left: 0, width: canvas.width });
    const told = [point && "White cross: the point of this answer.", to && `Yellow: what the drone then flew to, as in the live picture (${to.target ? "estimated from all answers" : "the end of its step"}).`];
    byId("opened-picture").replaceChildren(canvas, element("p", told.filter(Boolean).join(" "), { class: "faint" }));
  }
}

function pretty(text) {
  try {
    return JSON.stringify(JSON.parse(text), null, 2);
  } catch {
    return text;
  }
}
