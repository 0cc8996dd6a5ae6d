/** The daemon's REST API, wherever this page comes from: addresses are relative to this file's. */

const ROOT = new URL("../api/v1/", import.meta.url);

/** What went wrong, in a sentence for people (`message`), and as a `code` to go by. */
export class Problem extends Error {
  constructor(document) {
    super(document.detail);
    this.code = document.code;
    this.status = document.status;
    this.errors = document.errors ?? [];
  }
}

const UNREACHABLE = { code: "unreachable", status: 0, detail: "The daemon does not answer." };

/** Return the address of a path under /api/v1, such as `runs/3/views`. */
export function address(path) {
  return new URL(path, ROOT).href;
}

/** Return the address of a WebSocket under /api/v1. */
export function socketAddress(path) {
  return address(path).replace(/^http/, "ws");
}

/** Requests. All of them throw a Problem. */
export class Api {
  /** The token of the lease that this page holds, which goes with whatever changes something. */
  lease = null;

  /** Return the document at `path`. */
  get(path, options = {}) {
    return this.ask("GET", path, options);
  }

  /** Send a document to `path`, and return the answer. */
  post(path, document = undefined, options = {}) {
    const body = document === undefined ? {} : { body: JSON.stringify(document) };
    return this.ask("POST", path, { ...body, ...options });
  }

  /** End what is at `path`. */
  delete(path, options = {}) {
    return this.ask("DELETE", path, options);
  }

  /** Ask, and return the answer's document, null where it has none. `options` as of `fetch`. */
  async ask(method, path, { headers = {}, signal, body } = {}) {
    const sent = { ...headers };
    if (body !== undefined) sent["Content-Type"] = "application/json";
    if (method !== "GET" && this.lease !== null) sent["X-Lease"] = this.lease;
    let answer;
    try {
      answer = await fetch(address(path), { method, headers: sent, body, signal, cache: "no-store" });
    } catch (error) {
      if (error.name === "AbortError") throw error;
      throw new Problem(UNREACHABLE);
    }
    const text = await answer.text();
    const isJson = (answer.headers.get("Content-Type") ?? "").includes("json");
    const document = isJson && text ? JSON.parse(text) : null;
    if (answer.ok) return document;
    // A proxy in between has answers of its own, such as 502 while the daemon is away.
    throw new Problem(document?.detail ? document : { ...UNREACHABLE, status: answer.status });
  }
}
