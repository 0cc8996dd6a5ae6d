/** A run's views as they come: each its picture and how well it agrees; one of them enlarged. */

import { again } from "./again.js";
import { address } from "./api.js";
import { fill, h, setText } from "./elements.js";
import { USES } from "./plan.js";
import { quantity, reading } from "./units.js";

/** Milliseconds between two looks at the residuals, which the daemon works out for all views. */
const PAUSE = 1000;
const SMALL = 320;
const LARGE = 1280;

/** Fill `element` with the views of a run; returns what takes in its events, and what looks again. */
export function mountViews(element, page, signal, runId) {
  const list = h("ul", { class: "wall" });
  const empty = h("p", { class: "empty" }, "The first view comes when the axes have reached its position.");
  const enlarged = h("figure", { class: "enlarged", tabindex: "-1", hidden: true, "aria-label": "Enlarged view" });
  const count = h("p", { class: "hint" });
  const head = h("div", { class: "panel-head" }, h("h2", { id: "taken-title" }, "Views"), count);
  fill(element, head, enlarged, empty, list);
  const base = `runs/${encodeURIComponent(runId)}/views`;
  const views = new Map();
  let arrived = new Set();
  let chosen = null; // the number of the one that is enlarged

  // A number may go to another picture when a run is taken up again: the name keeps browsers from mixing them up.
  const picture = ({ number: n, image }, width) => address(`${base}/${n}/image.jpg?width=${width}&of=${encodeURIComponent(image)}`);
  const look = again(judge, { pause: PAUSE, signal });

  async function judge() {
    arrived = new Set();
    let document;
    try {
      document = await page.api.get(base, { signal });
    } catch (error) {
      if (error.name === "AbortError") throw error;
      setText(count, error.message);
      return;
    }
    for (const view of document.views) show(view);
    const known = new Set(document.views.map((view) => view.number));
    for (const [n, view] of views) {
      if (known.has(n) || arrived.has(n)) continue;
      view.element.remove();
      views.delete(n);
    }
    tally();
  }

  function show(view) {
    const before = views.get(view.number);
    if (before?.view.image === view.image) {
      before.follow(view);
    } else {
      const card = new Card(view, picture(view, SMALL), () => page.live.state?.rig.axes ?? [], () => toggle(view.number));
      views.set(view.number, card);
      if (before === undefined) list.prepend(card.element);
      else before.element.replaceWith(card.element);
    }
    if (chosen === view.number) enlarge(chosen, false);
  }

  function tally() {
    empty.hidden = views.size > 0;
    setText(count, views.size ? `${views.size}, the newest first; px: how far its points are off. Click one, or ← → and Enter, to enlarge it.` : "");
    if (list.contains(document.activeElement)) return;
    list.querySelectorAll("button").forEach((button, i) => (button.tabIndex = i ? -1 : 0));
  }

  function toggle(n) {
    if (chosen === n) close();
    else enlarge(n, true);
  }

  function enlarge(n, focus) {
    const { view, words } = views.get(n);
    chosen = n;
    for (const card of views.values()) card.press(card.view.number === n);
    const step = (by, text) => {
      const button = h("button", { type: "button", onclick: () => enlarge(n + by, true) }, text);
      button.disabled = !views.has(n + by);
      return button;
    };
    const source = picture(view, LARGE);
    let image = enlarged.querySelector("img");
    if (image?.src !== source) image = h("img", { src: source, alt: `Picture of view ${n}` });
    fill(
      enlarged,
      h("figcaption", {}, h("strong", {}, `View ${n}`), ` ${words()}`),
      h("div", { class: "buttons" }, step(-1, "Previous"), step(1, "Next"), h("button", { type: "button", onclick: close }, "Close")),
      image,
    );
    enlarged.hidden = false;
    if (focus) enlarged.focus();
  }

  function close() {
    const button = views.get(chosen)?.button;
    chosen = null;
    enlarged.hidden = true;
    for (const card of views.values()) card.press(false);
    button?.focus();
  }

  enlarged.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (by === undefined) return;
    event.preventDefault();
    if (views.has(chosen + by)) enlarge(chosen + by, true);
  });
  list.addEventListener("keydown", (event) => {
    const cards = [...list.querySelectorAll("button")];
    const at = cards.indexOf(document.activeElement);
    const to = { ArrowLeft: at - 1, ArrowRight: at + 1, Home: 0, End: cards.length - 1 }[event.key];
    if (to === undefined || at < 0) return;
    event.preventDefault();
    cards[at].tabIndex = -1;
    const next = cards[Math.min(Math.max(to, 0), cards.length - 1)];
    next.tabIndex = 0;
    next.focus();
  });

  tally();
  return {
    look,
    tell(event) {
      if (event.type !== "view") return;
      arrived.add(event.view);
      show({ ...event, number: event.view }); // what it misses by is not known yet
      tally();
    },
  };
}

/** One view. */
class Card {
  #axes;
  #residual = h("span", { class: "residual" });
  #badge = h("span", { class: "badge" });

  constructor(view, source, axes, choose) {
    this.view = view;
    this.#axes = axes;
    const image = h("img", { src: source, alt: "", loading: "lazy", width: "160", height: "120" });
    const name = h("span", {}, h("span", { class: "visually-hidden" }, "View "), h("strong", {}, String(view.number)), " ", this.#badge);
    const where = h("span", { class: "where" }, this.#place());
    this.button = h("button", { type: "button", tabindex: "-1", onclick: choose }, [image, name, " ", this.#residual, " ", where]);
    this.element = h("li", {}, this.button);
    this.follow(view);
  }

  follow(view) {
    this.view = view;
    setText(this.#residual, view.residual_px === undefined ? "…" : quantity(view.residual_px, "px", 3));
    const badge = view.left_out ? "left out" : view.set_aside ? "set aside" : view.use === "verify" ? "held out" : "";
    setText(this.#badge, badge);
    this.#badge.hidden = badge === "";
    this.#badge.dataset.kind = badge;
  }

  press(isPressed) {
    this.button.setAttribute("aria-pressed", isPressed);
  }

  /** Say what there is to say of it. */
  words = () => {
    const { use, points, residual_px, held_out_px, set_aside, left_out } = this.view;
    const said = [
      `${this.#place()}, ${USES[use] ?? "left out"}`,
      `${points} points`,
      residual_px != null && `residual ${quantity(residual_px, "px", 3)}`,
      held_out_px != null && `${quantity(held_out_px, "px", 3)} against the fit of the others`,
      set_aside && "set aside, since it does not agree with the others",
      left_out && "left out by hand",
    ];
    return `${said.filter(Boolean).join("; ")}.`;
  };

  #place() {
    const { joint, readings } = this.view;
    const axes = this.#axes();
    const at = (axis, i) => `${axis.name}\u00a0${reading(readings[i], axis)}`;
    const all = axes.map(at);
    return joint === null || !axes.length ? all.join(", ") : all[axes.findIndex(({ name }) => name === joint)] ?? "";
  }
}
