/** The axes: where each is, and how it is moved by hand. */

import { fill, h, setText } from "./elements.js";
import { Jogging } from "./jogging.js";
import { Scales } from "./scales.js";
import { measureOf, number, quantity, reading, sentenceOf, sign } from "./units.js";

/** Jog steps in mm or degrees, or in whatever an axis counts, as shares of a power of ten. */
const STEPS = { mm: [0.1, 1, 10, 100], deg: [0.1, 1, 5, 15] };

/** Fill `element` with the axes of the rig. */
export function mountAxes(element, page, signal) {
  const cards = h("div", { class: "cards" });
  const fieldset = h("fieldset", { class: "bare" }, cards);
  const pad = h("div", { class: "pad", tabindex: "0", role: "application", "aria-describedby": "pad-help" });
  const help = h("p", { id: "pad-help", class: "hint" }, "Click above, then ↑ ↓ choose the axis and ← → move it: by a step, or for as long as the key is held.");
  fill(element, h("div", { class: "panel-head" }, h("h2", { id: "axes-title" }, "Axes")), fieldset, h("div", {}, pad, help));
  page.guard(fieldset, signal);

  const jogging = new Jogging(page, signal);
  const scales = new Scales(page, signal);
  const shown = new Map();
  let chosen = 0;

  page.follow((state) => {
    const axes = state?.rig.axes ?? [];
    if (axes.some((axis) => !shown.has(axis.name))) {
      shown.clear();
      for (const axis of axes) shown.set(axis.name, new Card(axis, page, jogging, scales, signal));
      fill(cards, ...[...shown.values()].map((card) => card.element));
      choose(0);
    }
    for (const [name, card] of shown) card.follow(axes.find((axis) => axis.name === name) ?? null);
    pad.setAttribute("aria-disabled", page.obstacle("move") === null ? "false" : "true");
  }, signal);

  function choose(index) {
    const names = [...shown.keys()];
    chosen = Math.min(Math.max(index, 0), names.length - 1);
    setText(pad, `Keyboard jog: ${names[chosen]}`);
  }

  const direction = { ArrowLeft: -1, ArrowRight: 1 };
  pad.addEventListener("keydown", (event) => {
    const turn = { ArrowUp: -1, ArrowDown: 1 }[event.key];
    if (turn === undefined && direction[event.key] === undefined) return;
    event.preventDefault();
    if (event.repeat) return;
    if (turn !== undefined) choose(chosen + turn);
    else if (page.obstacle("move") === null) [...shown.values()][chosen].jog.press(direction[event.key]);
  });
  pad.addEventListener("keyup", (event) => direction[event.key] && jogging.release());
  pad.addEventListener("blur", () => jogging.release());
}

/** One axis on screen. */
class Card {
  #page;
  #axis;
  #measure;
  #scales;
  #position = h("output", { class: "position" }, "–");
  #scaled = h("span", { class: "scaled" });
  #condition = h("span", { class: "condition" });
  #marker = h("i", {});
  #home = h("button", { type: "button", class: "home", onclick: () => this.#goHome() }, "Home");
  #error = h("p", { class: "problem", role: "status" });

  constructor(axis, page, jogging, scales, signal) {
    this.#page = page;
    this.#scales = scales;
    this.#axis = axis;
    this.#measure = measureOf(axis);
    const { name } = axis;
    const step = this.#steps();
    this.#home.append(h("span", { class: "visually-hidden" }, ` ${name}`));
    this.jog = jogging.of(() => this.#axis, () => Number(step.value) / this.#measure.factor);
    const arrow = (label, text, way) => {
      const button = h("button", { type: "button", class: "jog", "aria-label": `Jog ${name} ${label}; hold to go on` }, text);
      this.jog.attach(button, way, signal);
      return button;
    };
    this.element = h(
      "article",
      { class: "axis", "aria-label": `Axis ${name}` },
      h("div", { class: "axis-head" }, h("h3", {}, name), this.#condition, this.#scaled, this.#position),
      this.#bar(),
      h(
        "div",
        { class: "axis-controls" },
        h("div", { class: "group" }, arrow("backwards", "−", -1), step, arrow("forwards", "+", 1)),
        this.#goTo(),
        this.#home,
      ),
      this.#error,
    );
  }

  /** Show the axis as the state describes it, null while there is none. */
  follow(axis) {
    if (axis === null) {
      setText(this.#position, "–");
      setText(this.#condition, "not known");
      delete this.#condition.dataset.kind;
      this.#home.classList.remove("primary");
      setText(this.#scaled, "");
      this.#marker.hidden = true;
      return;
    }
    this.#axis = axis;
    setText(this.#position, reading(axis.position, axis));
    setText(this.#scaled, this.#inMeasure(axis));
    const condition = axis.lost ? "lost" : axis.fault ? "in fault" : axis.moving ? "moving" : axis.homed ? "homed" : "not homed";
    setText(this.#condition, condition);
    this.#condition.dataset.kind = condition;
    this.#home.classList.toggle("primary", condition === "not homed"); // what comes next
    this.#marker.hidden = axis.position === null || !axis.homed;
    const [low, high] = axis.limits;
    const share = Math.min(1, Math.max(0, (axis.position - low) / (high - low)));
    this.#marker.style.left = `${(100 * share).toFixed(2)}%`;
    const error = axis.lost ?? axis.fault ?? axis.last_error;
    setText(this.#error, error === null ? "" : sentenceOf(error));
  }

  /** Return what a reading in counts is in mm or degrees, by the active calibration. */
  #inMeasure(axis) {
    const scale = this.#scales.get(axis.name);
    if (this.#measure.unit !== axis.unit || axis.unit in STEPS || scale === null || axis.position === null) return "";
    return `≈ ${quantity(axis.position * scale, axis.kind === "revolute" ? "deg" : "mm", 3)}`;
  }

  #bar() {
    const [low, high] = this.#axis.limits;
    const { factor, unit, digits } = this.#measure;
    const limit = (value) => quantity(Number((value * factor).toFixed(digits)), unit, null);
    return h(
      "div",
      { class: "travel" },
      h("div", { class: "bar" }, this.#marker),
      h("span", {}, limit(low)),
      h("span", {}, limit(high)),
    );
  }

  #steps() {
    const { unit, factor } = this.#measure;
    const [low, high] = this.#axis.limits;
    const span = (high - low) * factor;
    const power = 10 ** Math.round(Math.log10(span / 1000));
    const steps = (STEPS[unit] ?? [power, 10 * power, 100 * power]).filter((step) => step <= span);
    const options = steps.map((step, i) => h("option", { value: step, selected: i === 1 }, `${step}${sign(unit)}`));
    return h("select", { "aria-label": `Step of ${this.#axis.name}` }, ...options);
  }

  #goTo() {
    const { factor, unit, digits } = this.#measure;
    const { name, limits } = this.#axis;
    const [low, high] = limits.map((limit) => limit * factor);
    const input = h("input", {
      type: "number",
      step: "any",
      min: low,
      max: high,
      required: true,
      placeholder: `go to, ${unit}`,
      "aria-label": `Go to, ${name}, ${unit}`,
      title: `${number(low, digits)} to ${quantity(high, unit, digits)}`,
    });
    const form = h("form", { class: "group" }, input, h("button", {}, "Go", h("span", { class: "visually-hidden" }, ` with ${name}`)));
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.#do("move", { targets: { [name]: Number(input.value) / factor } });
    });
    return form;
  }

  #goHome() {
    return this.#do("home", { axis: this.#axis.name });
  }

  #do(command, parameters) {
    return this.#page.attempt(async () => {
      await this.#page.lease.need();
      await this.#page.live.do(command, parameters);
    });
  }
}
