// The web socket to the server: reconnects by itself, and reports when the last view is too old.

const STALE_MS = 1200;   // the server sends five views a second
const GIVE_UP_MS = 4000; // an open socket without data is replaced
const RETRY_MS = [200, 400, 800, 1500];

export class Link {
  #socket = null;
  #receivedAt = null;
  #openedAt = 0;
  #failures = 0;
  #retry = null;

  // onView(view) draws; onAge(age in ms or null, isStale) is called four times a second.
  constructor(path, onView, onAge) {
    this.path = path;
    this.onView = onView;
    this.onAge = onAge;
    this.#connect();
    setInterval(() => this.#check(), 250);
  }

  send(command) {
    if (this.#socket?.readyState === WebSocket.OPEN) this.#socket.send(command);
  }

  #connect() {
    this.#retry = null;
    this.#openedAt = performance.now();
    const socket = new WebSocket(new URL(this.path, location.href.replace(/^http/, "ws")));
    this.#socket = socket;
    socket.onmessage = (message) => this.#receive(socket, message.data);
    socket.onclose = () => this.#closed(socket);
  }

  #receive(socket, data) {
    if (socket !== this.#socket) return;
    const space = data.indexOf(" ");
    const number = data.slice(0, space);
    this.#receivedAt = performance.now();
    this.#failures = 0;
    this.onView(JSON.parse(data.slice(space + 1)));
    this.onAge(0, false);
    const confirm = () => { if (socket.readyState === WebSocket.OPEN) socket.send(`shown ${number}`); };
    // A visible page confirms after drawing; browsers do not draw a hidden page.
    if (document.hidden) confirm();
    else requestAnimationFrame(() => setTimeout(confirm));
  }

  #closed(socket) {
    if (socket !== this.#socket || this.#retry !== null) return;
    const wait = RETRY_MS[Math.min(this.#failures, RETRY_MS.length - 1)];
    this.#failures += 1;
    this.#retry = setTimeout(() => this.#connect(), wait);
  }

  #check() {
    const now = performance.now();
    const age = this.#receivedAt === null ? null : now - this.#receivedAt;
    this.onAge(age, age === null || age > STALE_MS);
    if (now - Math.max(this.#receivedAt ?? 0, this.#openedAt) > GIVE_UP_MS && this.#retry === null) {
      const socket = this.#socket;
      this.#closed(socket);
      socket.close();
    }
  }
}
