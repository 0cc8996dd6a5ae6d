/** A run's views, the worst first: to look at, to drop, and to solve the run again without. */

import { address } from "./api.js";
import { fill, h } from "./elements.js";
import { readings } from "./paper_tables.js";
import { drawOnPicture, magnification, summaryOf } from "./residual_plots.js";
import { number, quantity } from "./units.js";
import { digitsOf, movedBy } from "./verdict.js";

/** Views that are listed before the rest is asked for. */
const FEW = 8;

/**
 * Fill `element` with the views of `run` as a calibration says of them; `solve` is called with those to do without.
 * Returns what takes the residuals when they are there.
 */
export function mountViews(element, { run, views, axes, page, signal, solve }) {
  const dropped = new Set(views.filter((view) => view.left_out).map((view) => view.number));
  const before = new Set(dropped);
  const sorted = [...views].sort((a, b) => miss(b) - miss(a));
  const worst = Math.max(...sorted.map(miss), 1e-9);
  const digits = digitsOf(worst);
  const body = h("tbody", {});
  const all = h("button", { type: "button", class: "plain" });
  const again = h("button", { type: "button", class: "primary" });
  const progress = h("p", { class: "progress", role: "status" });
  const fieldset = h("fieldset", { class: "bare solving" }, again, progress);
  const pointless = h("p", { class: "hint", hidden: true }, "Held-out views are what is predicted: without these alone the verdict changes, and the calibration does not.");
  const viewer = h("figure", { class: "viewer", "aria-live": "polite" });
  let residuals = null;
  let shown = null;
  let whole = sorted.length <= FEW;

  function list() {
    fill(body, ...(whole ? sorted : sorted.slice(0, FEW)).map(row));
    mark();
    all.hidden = sorted.length <= FEW;
    all.textContent = whole ? "Show the worst alone" : `Show all ${sorted.length} views`;
  }

  /** Mark the row of the view that is looked at; the focus stays where it is. */
  function mark() {
    for (const each of body.rows) each.toggleAttribute("data-shown", each.dataset.view === String(shown?.number));
  }

  function row(view) {
    const drop = h("input", { type: "checkbox", "aria-label": `Drop view ${view.number}`, checked: dropped.has(view.number) });
    drop.addEventListener("change", () => {
      if (drop.checked) dropped.add(view.number);
      else dropped.delete(view.number);
      tellWhat();
    });
    const look = h("button", { type: "button", class: "plain", onclick: () => show(view) }, `View ${view.number}`);
    const value = view.held_out_px ?? view.residual_px;
    const length = h("i", { class: "length", "aria-hidden": "true" });
    length.style.setProperty("--share", Math.max(miss(view), 0) / worst);
    const remark = view.left_out ? "left out" : view.set_aside ? "set aside" : view.use === "verify" ? "held out" : "";
    return h(
      "tr",
      { "data-view": view.number },
      h("td", {}, drop),
      h("th", { scope: "row" }, look),
      h("td", {}, movedBy(view.joint), remark ? [" ", h("span", { class: "remark" }, remark)] : null),
      h("td", { class: "number" }, readings(view.readings, axes)),
      h("td", { class: "number error" }, length, h("span", {}, number(value, digits))),
    );
  }

  function tellWhat() {
    const same = dropped.size === before.size && [...dropped].every((each) => before.has(each));
    again.disabled = same;
    const changed = views.filter(({ number }) => dropped.has(number) !== before.has(number));
    pointless.hidden = same || changed.some(({ use }) => use !== "verify");
    const count = `${dropped.size} view${dropped.size === 1 ? "" : "s"}`;
    again.textContent = same ? "Solve again without the ticked views" : dropped.size ? `Solve again without ${count}` : "Solve again with all views";
  }

  async function show(view) {
    shown = view;
    mark();
    const canvas = h("canvas", { role: "img", "aria-label": `Picture of view ${view.number}, on its way` });
    const words = h("figcaption", {});
    fill(viewer, canvas, words);
    const image = new Image();
    image.src = address(`runs/${encodeURIComponent(run)}/views/${view.number}/image.jpg?width=1280`);
    try {
      await image.decode();
    } catch {
      fill(viewer, h("p", { class: "problem" }, `The picture of view ${view.number} cannot be shown.`));
      return;
    }
    if (shown !== view || signal.aborted) return;
    draw(canvas, words, image, view);
  }

  function draw(canvas, words, image, view) {
    const found = residuals?.views.find((each) => each.number === view.number);
    const size = { width: residuals?.width ?? image.naturalWidth, height: residuals?.height ?? image.naturalHeight };
    const points = found ? found.pixels.map(([x, y], i) => ({ x, y, dx: found.residuals[i][0], dy: found.residuals[i][1] })) : [];
    const times = magnification(points, size.width);
    drawOnPicture(canvas, image, points, size, times);
    const { rms } = summaryOf(points);
    const what = found
      ? `${points.length} points, rms ${quantity(rms, "px", digitsOf(rms))}; arrows are ${times.toLocaleString()} times as long as the residuals`
      : residuals === null
        ? "the residuals are still being worked out"
        : "the target is not found in it";
    canvas.setAttribute("aria-label", `Picture of view ${view.number}: ${what}`);
    fill(words, `View ${view.number}: ${what}.`);
  }

  all.addEventListener("click", () => {
    whole = !whole;
    list();
  });
  again.addEventListener("click", () => solve([...dropped].sort((a, b) => a - b), (text) => fill(progress, text)));
  page.guard(fieldset, signal, () => {
    const obstacle = page.obstacle("operate");
    const busy = page.live.state?.rig.run ?? null;
    if (obstacle !== null || busy === null) return obstacle;
    return busy === run ? "Its views are being solved." : "A run is under way: wait for it, or cancel it.";
  });
  const heads = ["Drop", "View", "Moved", "Readings", "Error (px)"].map((title, i) =>
    h("th", { scope: "col", class: i > 2 ? "number" : null }, title),
  );
  const caption = "The worst first. Error: how far a view’s points are off (rms), predicted from all other views where that is known";
  fill(
    element,
    h(
      "div",
      { class: "views" },
      h(
        "div",
        { class: "listed" },
        h(
          "div",
          { class: "table", role: "region", "aria-label": "Views, the worst first", tabindex: "0" },
          h("table", {}, h("caption", {}, caption), h("thead", {}, h("tr", {}, heads)), body),
        ),
        all,
        pointless,
        fieldset,
      ),
      viewer,
    ),
  );
  list();
  tellWhat();
  if (sorted.length) show(sorted[0]);
  else fill(viewer, h("p", { class: "empty" }, "There are no views."));

  return (found) => {
    residuals = found;
    if (shown !== null) show(shown);
  };
}

function miss(view) {
  return view.held_out_px ?? view.residual_px ?? -1;
}
