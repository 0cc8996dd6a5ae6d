/**
 * What every section is given. A section is a module that exports
 *
 *     mount(element, page, { signal, path })
 *
 * which is called each time the section is shown: it fills `element`, which is empty, and listens. `signal` is
 * aborted when the section is left: give it to `addEventListener`, `fetch` and the like, and nothing is left over.
 * `path` is what follows the section's name in the address: ["abc"] for `#/judge/abc`.
 */

import { Api, Problem } from "./api.js";
import { fill, h } from "./elements.js";
import { Lease } from "./lease.js";
import { Live } from "./live.js";

const NAME = "activecam.name";
/** Milliseconds for which a notice stays. */
const NOTICE = 8000;

export class Page {
  api = new Api();
  live = new Live();
  lease = new Lease(this);

  /** Who asks: `key` (null where nobody is asked for one), `role`, `may`; null while there is no connection. */
  get you() {
    return this.live.state?.you ?? null;
  }

  /** The name under which this page moves and starts runs. */
  get owner() {
    return this.you?.key ?? (this.name || "somebody at the page");
  }

  /** What the user is called where no key says it, as they have told; empty where they have not. */
  get name() {
    return localStorage.getItem(NAME) ?? "";
  }

  set name(name) {
    localStorage.setItem(NAME, name.trim());
  }

  /**
   * Return in a sentence why the user cannot do something now, null where they can.
   * @param {"operate"|"move"} act Change something; move axes.
   */
  obstacle(act) {
    const { state } = this.live;
    if (state === null) return "There is no connection to the daemon.";
    if (!state.you.may.includes("move")) {
      return `Your key is of role “${state.you.role}”: it sees everything and changes nothing.`;
    }
    if (act === "operate") return null;
    const { stop, lease } = state.rig;
    if (stop.latched) return "All is stopped: acknowledge that first, at the top of the page.";
    if (lease !== null && lease.expires_at === null) return "A calibration run moves the rig: wait, or cancel it.";
    if (lease !== null && !this.lease.held) return `“${lease.owner}” has control: wait, or take over, at the top.`;
    return null;
  }

  /**
   * Keep a fieldset disabled while there is an obstacle, which is said at its beginning.
   * @param {HTMLFieldSetElement} fieldset
   * @param {() => string|null} obstacle
   */
  guard(fieldset, signal, obstacle = () => this.obstacle("move")) {
    const reason = h("p", { class: "reason" });
    fieldset.querySelector("legend") ? fieldset.querySelector("legend").after(reason) : fieldset.prepend(reason);
    const follow = () => {
      const sentence = obstacle();
      fieldset.disabled = sentence !== null;
      reason.hidden = sentence === null;
      if (sentence !== null && reason.textContent !== sentence) reason.textContent = sentence;
    };
    this.live.addEventListener("state", follow, { signal });
    follow();
  }

  /** Call `follow` now and with each new state (null while there is no connection). */
  follow(follow, signal) {
    this.live.addEventListener("state", () => follow(this.live.state), { signal });
    follow(this.live.state);
  }

  /** Do `work`; what goes wrong is told to the user. Returns whether it was done. */
  async attempt(work) {
    try {
      await work();
      return true;
    } catch (error) {
      if (error.name === "AbortError") return false;
      if (error.code === "unreachable" && !this.live.connected) return false; // which the banner says
      this.tell(error.message, "problem");
      if (!(error instanceof Problem)) throw error;
      return false;
    }
  }

  /** Tell the user something: a notice that goes by itself, which is read aloud where that is asked for. */
  tell(text, kind = "news") {
    const notice = h("p", { class: `notice ${kind}` }, text);
    const close = h("button", { type: "button", onclick: () => notice.remove(), "aria-label": "Close this notice" }, "×");
    notice.append(close);
    fill(document.getElementById("notices"), notice);
    setTimeout(() => notice.remove(), NOTICE);
  }
}
