// One WebSocket of frames for everything on the page that shows them: a frame, its acknowledgement, the next frame.

import { frameOf } from "./frame.js";

const RETRY_MS = 1000;
const REMEMBERED = 120; // frames whose age is kept

const streams = new Map();

// The stream of an address; whoever shows it joins, and it is open while somebody has joined.
export function streamOf(address) {
  if (!streams.has(address)) streams.set(address, new FrameStream(address));
  return streams.get(address);
}

class FrameStream {
  constructor(address) {
    this.address = address;
    this.showing = new Set();
    this.frame = null; // the newest
    this.analysis = null; // what it shows, as the server analysed it
    this.waiting = "waiting for the camera";
    this.drawn = []; // of the last frames: when each was drawn, and how old it was then, ms
    this.toggle = () => (document.hidden ? this.close() : this.open()); // a page that nobody sees costs nothing
  }

  // Show frames from now on; returns what ends it. A show has some of frame(frame), analysis(analysis), waiting(text).
  join(show) {
    this.showing.add(show);
    if (this.showing.size === 1) {
      document.addEventListener("visibilitychange", this.toggle);
      this.toggle();
    }
    show.waiting?.(this.waiting);
    if (this.frame) show.frame?.(this.frame);
    show.analysis?.(this.analysis);
    return () => this.leave(show);
  }

  leave(show) {
    this.showing.delete(show);
    if (this.showing.size) return;
    document.removeEventListener("visibilitychange", this.toggle);
    this.close();
    this.frame = this.analysis = null;
    this.drawn = [];
  }

  open() {
    clearTimeout(this.retry);
    if (this.socket) return;
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(`${scheme}//${location.host}${this.address}`);
    socket.binaryType = "arraybuffer";
    socket.onmessage = (event) => this.receive(event.data, socket);
    socket.onclose = () => {
      if (socket !== this.socket) return; // closed on purpose
      this.socket = null;
      this.say("the connection is lost; trying again");
      this.retry = setTimeout(() => this.open(), RETRY_MS);
    };
    this.socket = socket;
  }

  close() {
    clearTimeout(this.retry);
    const socket = this.socket;
    this.socket = null;
    socket?.close();
    this.say("waiting for the camera");
  }

  async receive(data, socket) {
    if (typeof data === "string") {
      this.analysis = JSON.parse(data);
      this.notify("analysis", this.analysis);
      return;
    }
    try {
      const frame = await frameOf(data);
      if (socket !== this.socket) return;
      this.frame = frame;
      this.say("");
      this.notify("frame", frame);
      this.drawn.push([performance.now(), Date.now() - frame.arrivedMs]);
      if (this.drawn.length > REMEMBERED) this.drawn.shift();
    } catch (error) {
      console.error(`a frame could not be shown: ${error.message}`);
    }
    if (socket.readyState === WebSocket.OPEN) socket.send("ok"); // also of a frame that failed: the next one may not
  }

  say(text) {
    if (text === this.waiting) return;
    this.waiting = text;
    this.notify("waiting", text);
  }

  notify(kind, what) {
    this.showing.forEach((show) => show[kind]?.(what));
  }

  // Frames drawn a second, over the last ones.
  rate() {
    const { drawn } = this;
    const span = drawn.length > 1 ? drawn[drawn.length - 1][0] - drawn[0][0] : 0;
    return span > 0 ? ((drawn.length - 1) * 1000) / span : 0;
  }
}
