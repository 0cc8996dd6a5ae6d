/** How the views of the latest run cover the picture: a layer over it, and bars beside. */

import { fill, h } from "./elements.js";
import { sentenceOf } from "./units.js";

const BARS = [
  ["x", "X, sideways", "How far the target went from side to side"],
  ["y", "Y, up and down", "How far it went from top to bottom"],
  ["size", "Size", "How large it was in the largest view"],
  ["skew", "Skew", "How far it leaned"],
];
/** Milliseconds after a view within which others are waited for. */
const GATHERED = 1000;

export class Coverage {
  /** What the daemon says of it, null where nothing is shown. */
  document = null;
  #element;
  #page;
  #signal;
  #changed;
  #shown = false;
  #timer = null;

  /** Fill `element` while it is shown; `changed` is called whenever there is something else to draw. */
  constructor(element, page, signal, changed) {
    this.#element = element;
    this.#page = page;
    this.#signal = signal;
    this.#changed = changed;
    element.hidden = true;
    page.live.addEventListener("event", ({ detail }) => detail.type === "view" && this.#soon(), { signal });
    signal.addEventListener("abort", () => clearTimeout(this.#timer));
  }

  /** Show it, or do not. */
  async show(shown) {
    this.#shown = shown;
    this.#element.hidden = !shown;
    if (shown) {
      await this.#load();
    } else {
      this.document = null;
      this.#changed();
    }
  }

  /** Draw the cells over a picture of this size: the darker a cell, the less was seen in it. */
  draw(context, width, height) {
    if (this.document === null) return;
    const { cells } = this.document;
    const [high, wide] = [height / cells.length, width / cells[0].length];
    const most = Math.max(1, ...cells.flat());
    cells.forEach((row, i) =>
      row.forEach((count, j) => {
        const [x, y] = [j * wide, i * high];
        context.fillStyle = count ? `rgb(62 224 111 / ${0.2 + (0.45 * count) / most})` : "rgb(0 0 0 / 55%)";
        context.fillRect(x + 1, y + 1, wide - 2, high - 2);
      }),
    );
  }

  #soon() {
    clearTimeout(this.#timer);
    if (this.#shown) this.#timer = setTimeout(() => this.#page.attempt(() => this.#load()), GATHERED);
  }

  async #load() {
    const { api, live } = this.#page;
    const signal = this.#signal;
    const run = live.state?.run ?? (await api.get("runs", { signal }))[0];
    if (run === undefined) {
      fill(this.#element, h("p", { class: "hint" }, "There is no run yet whose views could cover anything."));
      return;
    }
    if (this.document === null) fill(this.#element, h("p", { class: "hint" }, `Looking at the pictures of run ${run.id} …`));
    const found = await api.get(`runs/${run.id}/coverage`, { signal });
    if (!this.#shown) return;
    this.document = found;
    this.#changed();
    this.#tell(found, run);
  }

  #tell(found, run) {
    const bars = BARS.map(([key, name, meaning]) => bar(name, meaning, found[key]));
    const views = found.views === 1 ? "1 view" : `${found.views} views`;
    fill(
      this.#element,
      h("p", { class: "hint" }, `${views} of run ${run.id}; green: the target was seen there, dark: it was not.`),
      h("div", { class: "bars" }, ...bars),
      h("ul", { class: "faults" }, ...found.missing.map((each) => h("li", {}, sentenceOf(each)))),
    );
  }
}

function bar(name, meaning, share) {
  const percent = Math.round(100 * share);
  const level = h("i", {});
  level.style.width = `${percent}%`;
  const meter = { role: "meter", "aria-label": `${name}: ${meaning}`, "aria-valuenow": percent, "aria-valuemin": 0, "aria-valuemax": 100 };
  return h("div", { class: "coverage-bar", title: meaning }, h("span", {}, name), h("div", { class: "meter", ...meter }, level), h("span", { class: "number" }, `${percent} %`));
}
