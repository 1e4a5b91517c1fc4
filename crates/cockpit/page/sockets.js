// The two connections: one for pictures and state, one for the controls alone, so that neither waits for the other.

/** A server that says nothing for this long is lost: with a beat each 250 ms, and checked each 100 ms, the page says so within a second. */
const LOST_AFTER = 700;
const CHECK = 100;
/** A silent connection is opened anew after this time. */
const AGAIN_AFTER = 4000;
const CONFIRMED_WITHIN = 1500;

/** What gives the right to fly: from the address, then from the session that it opened. Kept for this tab only. */
const secrets = {
  token: location.hash.slice(1),
  get session() { return sessionStorage.getItem("session") ?? ""; },
  set session(value) { sessionStorage.setItem("session", value); },
};
if (secrets.token) {
  // A new address goes over an old session.
  sessionStorage.removeItem("session");
  sessionStorage.setItem("token", secrets.token);
  history.replaceState(null, "", location.pathname);
} else {
  secrets.token = sessionStorage.getItem("token") ?? "";
}

function hello() {
  if (secrets.session) return { session: secrets.session, ...(secrets.token && { token: secrets.token }) };
  return secrets.token ? { token: secrets.token } : {};
}

/** A connection that is opened again when it is lost, until it is refused. */
class Connection {
  constructor(path, on) {
    [this.path, this.on, this.wait, this.over] = [path, on, 100, false];
    this.connect();
  }

  connect() {
    const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}${this.path}`);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onopen = () => {
      this.send({ hello: hello() });
      this.on.greeted?.();
    };
    socket.onmessage = ({ data }) => {
      if (this.socket !== socket) return;
      [this.heard, this.forgiven] = [performance.now(), 0];
      if (typeof data !== "string") return this.on.picture?.(data);
      const message = JSON.parse(data);
      if (message.type === "refused") this.over = true;
      else this.wait = 100;
      this.on.message(message);
    };
    socket.onclose = ({ code, reason }) => {
      if (this.socket !== socket) return;
      if (code === 1001) this.over = true;
      this.on.closed?.(this.over, reason);
      if (!this.over) setTimeout(() => this.connect(), this.wait);
      this.wait = Math.min(2000, this.wait * 1.6);
    };
  }

  /** Gives a connection up that says nothing, and opens another. */
  again() {
    const stale = this.socket;
    stale.onopen = stale.onmessage = stale.onclose = null;
    stale.close();
    this.connect();
  }

  send(message) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }
}

/** Pictures and state. */
export class Watch {
  constructor(on) {
    this.shown = 0;
    this.filming = false;
    const closed = (over, reason) => {
      [this.shown, this.filming] = [0, false];
      on.closed?.(over, reason);
    };
    const greeted = () => {
      this.shown = 0;
      on.greeted?.();
    };
    this.connection = new Connection("/watch", { ...on, closed, greeted });
  }

  /** A picture is on the screen: the next one may come. */
  confirm() {
    this.shown += 1;
    this.connection.send({ shown: this.shown });
  }

  /** Asks for pictures in this format, and counts them anew. */
  format(format) {
    [this.shown, this.filming] = [0, format === "film"];
    this.connection.send({ format });
  }

  open(query) {
    this.connection.send({ open: query });
  }
}

/** The controls. */
export class Controls {
  constructor(on) {
    [this.on, this.open, this.unconfirmed, this.next, this.lost] = [on, new Map(), new Set(), 1, true];
    this.since = performance.now();
    this.connection = new Connection("/control", {
      message: (message) => this.message(message),
      // Beats are counted anew.
      greeted: () => (this.tick = undefined),
      closed: (over, reason) => {
        for (const [, settle] of this.open) settle({ ok: false, text: "not sent: the connection is lost" });
        this.open.clear();
        this.say(true, over, reason);
      },
    });
    this.checked = performance.now();
    setInterval(() => this.check(), CHECK);
    // Browsers slow the timers of hidden pages down, though not their sockets: beats are answered, and what is known is told at once when the page is seen again.
    document.addEventListener("visibilitychange", () => this.check());
  }

  /** A connection can fall silent without being closed. */
  check() {
    const [now, { connection }] = [performance.now(), this];
    const late = now - this.checked - CHECK;
    this.checked = now;
    // If this page itself was busy, what arrived meanwhile is still to be read.
    if (late > CHECK && !document.hidden) connection.forgiven = Math.min(LOST_AFTER, (connection.forgiven ?? 0) + late);
    const quiet = now - (connection.heard ?? this.since) - (connection.forgiven ?? 0);
    if (quiet > LOST_AFTER) this.say(true, connection.over);
    if (quiet > AGAIN_AFTER && !connection.over && connection.socket.readyState !== WebSocket.CONNECTING) {
      connection.heard = now;
      connection.again();
    }
  }

  /** The secret of this page's session; empty for one that only watches. */
  get session() {
    return secrets.session;
  }

  say(lost, over = false, reason = "") {
    if (lost === this.lost && !over) return;
    this.lost = lost;
    this.on.lost(lost, over, reason);
  }

  message(message) {
    switch (message.type) {
      case "welcome":
        if (message.session) secrets.session = message.session;
        this.say(false);
        this.on.welcome(message);
        break;
      case "session":
        secrets.session = message.session;
        this.on.welcome(message);
        break;
      case "beat":
        this.tick = message.n;
        this.connection.send({ beat: message.n });
        this.say(false);
        break;
      case "ack":
        this.open.get(message.id)?.(message);
        this.open.delete(message.id);
        if (this.unconfirmed.delete(message.id)) this.on.late(message);
        break;
      default:
        this.on.message(message);
    }
  }

  /** Sends an order with the last beat seen, by which the program knows how old it is. Resolves to what the server answered, or that it did not. */
  order(what) {
    const [id, began] = [this.next++, performance.now()];
    return new Promise((resolve) => {
      const settle = (answer) => resolve({ ...answer, ms: performance.now() - began });
      if (this.connection.socket.readyState !== WebSocket.OPEN) {
        return settle({ ok: false, text: "not sent: no connection" });
      }
      this.open.set(id, settle);
      this.connection.send({ order: { id, tick: this.tick, do: what } });
      setTimeout(() => {
        if (!this.open.delete(id)) return;
        this.unconfirmed.add(id);
        const dropped = what === "hold" || what === "land" ? "" : "; it is dropped if it arrives late";
        settle({ ok: false, text: `not confirmed: no answer${dropped}` });
      }, CONFIRMED_WITHIN);
    });
  }
}
