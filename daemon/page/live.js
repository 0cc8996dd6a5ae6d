/** The one socket of this page: the rig's state, events of runs, and commands. It comes back by itself. */

import { Problem, socketAddress } from "./api.js";

const FIRST_PAUSE = 300;
const LONGEST_PAUSE = 4000;
/** Milliseconds without a message after which the daemon is taken for dead; it sends one each second. */
const SILENCE = 3500;

const GONE = { code: "unreachable", status: 0, detail: "The daemon does not answer." };

/**
 * What the daemon says as it happens. Its events:
 * - `state`: `live.state` is new; null while there is no connection.
 * - `event`: a run's event, in `detail`; all of the latest run are in `live.events`.
 * - `refused`: the socket was not opened. Why is not told to scripts: see `GET /session`.
 */
export class Live extends EventTarget {
  state = null;
  events = [];
  #socket = null;
  #waiting = new Map();
  #number = 0;
  #pause = FIRST_PAUSE;
  #again = null;
  #silence = null;

  get connected() {
    return this.state !== null;
  }

  /** Connect, now; does nothing where that is under way. */
  connect() {
    if (this.#socket !== null) return;
    clearTimeout(this.#again);
    const socket = new WebSocket(socketAddress("live"));
    let opened = false;
    this.#socket = socket;
    socket.onopen = () => {
      opened = true;
    };
    socket.onmessage = (message) => {
      if (this.#socket !== socket) return;
      this.#listen();
      this.#take(JSON.parse(message.data));
    };
    socket.onclose = () => {
      if (this.#socket === socket) this.#lose(opened);
    };
    this.#listen();
  }

  /**
   * Carry out a command, and return what it is answered; throws a Problem.
   * @param {string} command As docs/reference/api.md names it: "jog", say.
   */
  do(command, parameters = {}) {
    if (!this.connected) return Promise.reject(new Problem(GONE));
    const id = ++this.#number;
    return new Promise((resolve, reject) => {
      this.#waiting.set(id, { resolve, reject });
      this.#socket.send(JSON.stringify({ id, do: command, ...parameters }));
    });
  }

  #take(message) {
    if (message.type === "state") {
      this.#pause = FIRST_PAUSE;
      this.state = message;
      this.dispatchEvent(new Event("state"));
    } else if (message.type === "event") {
      this.#note(message.event);
    } else if (message.type === "answer") {
      const asker = this.#waiting.get(message.id);
      this.#waiting.delete(message.id);
      if (message.problem) asker?.reject(new Problem(message.problem));
      else asker?.resolve(message.body);
    }
  }

  /** After a reconnection all events of the run come again: those that are known are dropped. */
  #note(event) {
    const last = this.events.at(-1);
    if (last?.run_id !== event.run_id) this.events = [];
    else if (event.sequence <= last.sequence) return;
    this.events.push(event);
    this.dispatchEvent(new CustomEvent("event", { detail: event }));
  }

  #listen() {
    clearTimeout(this.#silence);
    this.#silence = setTimeout(() => this.#lose(true), SILENCE);
  }

  #lose(opened) {
    clearTimeout(this.#silence);
    const socket = this.#socket;
    this.#socket = null;
    this.state = null;
    socket.close();
    for (const { reject } of this.#waiting.values()) reject(new Problem(GONE));
    this.#waiting.clear();
    this.dispatchEvent(new Event("state"));
    if (!opened) this.dispatchEvent(new Event("refused"));
    this.#again = setTimeout(() => this.connect(), this.#pause);
    this.#pause = Math.min(2 * this.#pause, LONGEST_PAUSE);
  }
}
