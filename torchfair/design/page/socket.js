// The connection: says hello, hands messages on, comes back by itself after it broke.

import { PROTOCOL, decode, encodeContainer } from "./protocol.js";

const PAUSES = [250, 500, 1000, 2000];
const FINAL = {
  4401: "This address has no valid token. Open the address that the command printed, with everything after the #.",
  4409: "The page and the server are of different versions. Reload the page.",
};

export class Connection {
  // on(message) gets every message, status(kind, sentence) what became of the connection: open, lost, refused
  constructor(on, status) {
    this.on = on;
    this.status = status;
    this.tries = 0;
    this.next = 1;
    this.waiting = new Map();
    this.connect();
  }

  connect() {
    const address = new URL("socket", document.baseURI);
    address.protocol = address.protocol.replace("http", "ws");
    address.hash = "";
    this.socket = new WebSocket(address);
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => this.send("hello", { token: token(), protocol: PROTOCOL });
    this.socket.onmessage = ({ data }) => this.receive(data);
    this.socket.onclose = ({ code }) => this.closed(code);
  }

  receive(data) {
    const message = decode(data);
    if (message.type === "welcome") {
      this.tries = 0;
      this.status("open", "");
    }
    if ((message.type === "done" || message.type === "error") && this.waiting.has(message.id)) {
      this.waiting.get(message.id)(message);
      this.waiting.delete(message.id);
    }
    this.on(message);
  }

  closed(code) {
    for (const answer of this.waiting.values()) answer({ type: "error", sentence: "The connection was lost." });
    this.waiting.clear();
    if (FINAL[code]) return this.status("refused", FINAL[code]);
    const pause = PAUSES[Math.min(this.tries++, PAUSES.length - 1)];
    setTimeout(() => this.connect(), pause);
    const stopped = code === 1001 || this.tries > 2;
    this.status("lost", stopped
      ? "The server does not answer. The page goes on as soon as the command runs again."
      : "The connection was lost. Connecting again …");
  }

  get open() { return this.socket.readyState === WebSocket.OPEN; }

  send(type, fields = {}) {
    if (this.open) this.socket.send(JSON.stringify({ type, ...fields }));
  }

  // Like send; the promise gives the `done` or `error` that answers.
  ask(type, fields = {}) {
    const id = this.next++;
    if (!this.open) return Promise.resolve({ type: "error", id, sentence: "There is no connection." });
    this.send(type, { ...fields, id });
    return new Promise((resolve) => this.waiting.set(id, resolve));
  }

  upload(name, bytes) {
    if (this.open) this.socket.send(encodeContainer({ type: "upload", name }, "bytes", bytes));
  }
}

// The token of the address, kept for a reload without it.
function token() {
  const given = new URLSearchParams(location.hash.slice(1)).get("token");
  try {
    if (given) sessionStorage.setItem("token", given);
    return given ?? sessionStorage.getItem("token") ?? "";
  } catch { // no storage in some frames
    return given ?? "";
  }
}
