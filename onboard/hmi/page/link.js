// The web socket to the car: reconnects by itself, and says when what it brought is old.

const STALE_MS = 1200;   // views come five times a second
const GIVE_UP_MS = 4000; // an open socket that brings nothing is not to be trusted
const RETRY_MS = [200, 400, 800, 1500];

export class Link {
  #socket = null;
  #heardAt = null;
  #openedAt = 0;
  #failures = 0;
  #retry = null;

  // onView(view) draws; onAge(milliseconds or null, isStale) is called four times a second.
  constructor(path, onView, onAge) {
    this.path = path;
    this.onView = onView;
    this.onAge = onAge;
    this.#connect();
    setInterval(() => this.#look(), 250);
  }

  send(word) {
    if (this.#socket?.readyState === WebSocket.OPEN) this.#socket.send(word);
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
    this.#heardAt = performance.now();
    this.#failures = 0;
    this.onView(JSON.parse(data.slice(space + 1)));
    this.onAge(0, false);
    const confirm = () => { if (socket.readyState === WebSocket.OPEN) socket.send(`shown ${number}`); };
    // A page that is in view confirms what has been drawn; one that is not is not drawn at all.
    if (document.hidden) confirm();
    else requestAnimationFrame(() => setTimeout(confirm));
  }

  #closed(socket) {
    if (socket !== this.#socket || this.#retry !== null) return;
    const wait = RETRY_MS[Math.min(this.#failures, RETRY_MS.length - 1)];
    this.#failures += 1;
    this.#retry = setTimeout(() => this.#connect(), wait);
  }

  #look() {
    const now = performance.now();
    const age = this.#heardAt === null ? null : now - this.#heardAt;
    this.onAge(age, age === null || age > STALE_MS);
    if (now - Math.max(this.#heardAt ?? 0, this.#openedAt) > GIVE_UP_MS && this.#retry === null) {
      const socket = this.#socket;
      this.#closed(socket);
      socket.close();
    }
  }
}
