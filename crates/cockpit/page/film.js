// The live picture as H.264, decoded by the browser (WebCodecs). Where that is missing or fails, pictures come as JPEG.

/** An image that the decoder was given this long ago and has not returned: it does not work here, and the server waits. */
const PATIENCE = 2000;

export class Film {
  /** `shown(head, frame)` is given each image, `lost()` is called for one that never comes out, `failed()` once. */
  constructor(shown, lost, failed) {
    [this.shown, this.lost, this.failed, this.over] = [shown, lost, failed, !isSecureContext || !("VideoDecoder" in globalThis)];
    this.heads = new Map();
    if (!this.over) this.watch = setInterval(() => this.check(), PATIENCE / 4);
  }

  check() {
    const [oldest] = this.heads.values();
    const late = oldest && performance.now() - oldest.arrived > PATIENCE;
    // A page that was asleep gets its images a moment after this.
    this.late = late ? (this.late ?? 0) + 1 : 0;
    if (this.late > 1) this.fail("no image");
  }

  /** Whether to ask for a film. */
  get wanted() {
    return !this.over;
  }

  /** A new connection begins with a key frame. */
  restart() {
    this.heads.clear();
    if (this.decoder?.state === "configured") this.decoder.reset();
    this.codec = null;
  }

  /** Gives an access unit to the decoder. */
  decode(head, data) {
    if (this.over) return;
    try {
      if (head.key && !head.codec) return this.fail("a key frame without its codec");
      if (head.key && head.codec !== this.codec) this.configure(head.codec);
      if (!this.codec) return;
      this.at = (this.at ?? 0) + 33000;
      this.heads.set(this.at, { head, arrived: performance.now() });
      this.decoder.decode(new EncodedVideoChunk({ type: head.key ? "key" : "delta", timestamp: this.at, data }));
    } catch (error) {
      this.fail(error.message);
    }
  }

  configure(codec) {
    if (this.decoder?.state !== "configured" && this.decoder?.state !== "unconfigured") {
      this.decoder = new VideoDecoder({ output: (frame) => this.output(frame), error: (error) => this.fail(error.message) });
    }
    this.decoder.configure({ codec, optimizeForLatency: true });
    this.codec = codec;
  }

  output(frame) {
    try {
      const about = this.heads.get(frame.timestamp);
      // Images come out in order: those before it were lost, and must not be waited for.
      for (const at of [...this.heads.keys()].filter((at) => at < frame.timestamp)) {
        this.heads.delete(at);
        this.lost();
      }
      this.heads.delete(frame.timestamp);
      if (about && !this.over) this.shown(about.head, frame, about.arrived);
    } finally {
      frame.close();
    }
  }

  fail(why) {
    if (this.over) return;
    this.over = true;
    clearInterval(this.watch);
    if (this.decoder && this.decoder.state !== "closed") this.decoder.close();
    console.info(`The browser's video decoder does not work (${why}): pictures come as JPEG.`);
    this.failed();
  }
}
