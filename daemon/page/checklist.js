/** The checklist: what stands for and against a run, and beside each thing what mends it. */

import { fill, h, setText } from "./elements.js";
import { sentenceOf } from "./units.js";

const MARKS = { true: ["✓", "ok"], false: ["✗", "not ok"], null: ["?", "not known"] };

/** Whose the axes are where they are this page's, as a check. */
const OWN = { ok: true, message: "you have control" };

/** Fill `element`; returns what looks again. */
export function mountChecklist(element, page, signal) {
  const outcome = h("p", { class: "words", role: "status" });
  const list = h("ul", { class: "checks" });
  fill(element, h("h2", { id: "checklist-title" }, "Before the start"), outcome, list);
  const items = new Map();

  function show({ ready, checks: found }) {
    const checks = found.map((check) => (check.name === "free" && page.lease.held ? { ...check, ...OWN } : check));
    for (const check of checks) {
      if (!items.has(check.name)) items.set(check.name, new Item(check, page, signal));
      items.get(check.name).show(check);
    }
    const elements = checks.map(({ name }) => items.get(name).element);
    if (elements.some((each, i) => each !== list.children[i]) || elements.length !== list.children.length) fill(list, ...elements);
    const against = checks.filter(({ ok }) => ok === false).length;
    outcome.dataset.kind = ready ? "good" : "poor";
    const things = against === 1 ? "One thing is" : `${against} things are`;
    setText(outcome, ready ? "Ready: nothing stands against a run." : `${things} not as it should be for a good calibration.`);
  }

  return {
    async look(query) {
      try {
        show(await page.api.get(`runs/checklist?${query}`, { signal }));
      } catch (error) {
        if (error.name === "AbortError") throw error;
        outcome.dataset.kind = "poor";
        setText(outcome, error.message);
      }
    },
  };
}

/** One thing that is looked at. */
class Item {
  #mark = h("span", { class: "mark", "aria-hidden": "true" });
  #word = h("span", { class: "visually-hidden" });
  #message = h("p", { class: "hint" });
  #mend;

  constructor(check, page, signal) {
    this.#mend = mending(check.name, page, signal);
    const words = h("div", { class: "check-words" }, h("p", {}, check.title, this.#word), this.#message);
    this.element = h("li", {}, this.#mark, words, this.#mend);
  }

  show({ ok, message }) {
    const [mark, word] = MARKS[ok];
    this.element.dataset.ok = ok;
    setText(this.#mark, mark);
    setText(this.#word, `: ${word}`);
    setText(this.#message, sentenceOf(message));
    const isNeeded = this.#mend?.localName === "a" ? ok === false : ok !== true; // elsewhere one goes with a reason only
    if (this.#mend !== null) this.#mend.hidden = !isNeeded;
  }
}

/** Return the control that mends what a check is about, null where there is none. */
function mending(name, page, signal) {
  const control = (text, act, work) => {
    const button = h("button", { type: "button", onclick: () => page.attempt(() => work(button)) }, text);
    page.follow(() => {
      const obstacle = page.obstacle(act);
      button.disabled = obstacle !== null || button.hasAttribute("aria-busy");
      button.title = obstacle ?? "";
    }, signal);
    return button;
  };
  const toTheRig = (text) => h("a", { href: "#/rig" }, text);
  const controls = {
    stop: () => control("Acknowledge", "operate", () => page.live.do("acknowledge")),
    free: () => takingOver(page, signal, control),
    homed: () => control("Home all", "move", (button) => homeAll(page, button)),
    target: () => toTheRig("Move the axes"),
    room: () => toTheRig("Move the axes"),
  };
  return controls[name]?.() ?? null;
}

/** Somebody else's lease can be taken over, this page's own and a run's need not or cannot. */
function takingOver(page, signal, control) {
  const button = control("Take over", "operate", () => page.lease.take({ over: true }));
  const element = h("div", {}, button);
  page.follow((state) => {
    const lease = state?.rig.lease ?? null;
    button.hidden = lease === null || lease.expires_at === null || page.lease.held;
  }, signal);
  return element;
}

/** Home one axis after the other: two that move at once are harder to watch. */
async function homeAll(page, button) {
  button.setAttribute("aria-busy", "true");
  try {
    await page.lease.need();
    for (const { name, homed } of page.live.state.rig.axes) {
      if (!homed) await page.api.post(`axes/${encodeURIComponent(name)}/home?wait=true`);
    }
  } finally {
    button.removeAttribute("aria-busy");
  }
}
