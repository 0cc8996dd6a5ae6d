/**
 * Is it good? The verdict first, then what it rests on, what would help, and how it compares.
 *
 * `#/judge` is the calibration in use, or else the newest; `#/judge/ID` another one, `#/judge/ID/OTHER` beside a second.
 */

import { Problem } from "./api.js";
import { mountComparison } from "./comparison.js";
import { fill, h, table } from "./elements.js";
import { paperTables, parameterTables } from "./paper_tables.js";
import { drawByDirection, drawByPlace, magnification, pointsOf, summaryOf } from "./residual_plots.js";
import { moment, quantity, sentenceOf } from "./units.js";
import { activation, advice, digitsOf, figures, groundsOf, judgementOf, movedBy, takeAway, verdict } from "./verdict.js";
import { mountViews } from "./worst_views.js";

export async function mount(element, page, { signal, path }) {
  fill(element, h("p", { class: "empty", role: "status" }, "Loading …"));
  try {
    await show(element, page, signal, path);
  } catch (error) {
    if (!(error instanceof Problem)) throw error;
    fill(element, panel("Verdict", "verdict", h("p", { class: "problem", role: "alert" }, error.message), h("a", { href: "#/judge" }, "The calibration in use")));
  }
}

function panel(title, name, ...children) {
  const heading = `judge-${name}`;
  return h("section", { class: `panel judge-${name}`, "aria-labelledby": heading }, h("h2", { id: heading }, title), ...children);
}

async function show(element, page, signal, [chosen, other]) {
  const get = (path) => page.api.get(path, { signal });
  const reload = () => show(element, page, signal, [chosen, other]);
  const entries = await get("calibrations");
  if (!entries.length) {
    const words = "Nothing is calibrated yet: the first calibration run makes a calibration, which is judged here.";
    const next = h("p", {}, h("a", { class: "button", href: "#/calibrate/new" }, "Prepare a run"));
    fill(element, panel("Verdict", "verdict", h("p", { class: "empty" }, words), next));
    return;
  }
  const id = chosen ?? (entries.find((each) => each.active) ?? entries[0]).id;
  const [entry, tables] = await Promise.all([get(`calibrations/${id}`), get(`calibrations/${id}/tables`)]);
  const axes = (await get("rig")).axes;
  const quality = entry.calibration.quality;

  const beside = panel("Side by side", "beside", h("div", { class: "comparison" }));
  const plots = h("div", { class: "plots" });
  const views = h("div", {}, h("p", { class: "empty" }, "Loading …"));
  fill(
    element,
    other ? beside : panel("Verdict", "verdict", verdict(entry), activation(entry, page, signal, reload), takeAway(entry)),
    panel("Predicted against measured", "figures", figures(quality)),
    panel("What would help most", "advice", advice(quality)),
    panel("Views", "views", views),
    panel("Residuals", "residuals", plots),
    panel("The paper’s tables, for this rig", "tables", paperTables(tables, axes)),
    panel("Parameters", "parameters", h("div", { class: "columns" }, parameterTables(tables.parameters))),
    panel("All calibrations", "history", history(entries, id, other)),
  );
  if (other) {
    const second = await get(`calibrations/${other}`);
    await mountComparison(beside.querySelector(".comparison"), { entry, other: second, page, signal, done: reload });
  }
  if (entry.run_id === null) {
    fill(views, h("p", { class: "empty" }, "It is of no run of this daemon: its views are not here."));
    fill(plots, h("p", { class: "empty" }, "Its views are not here."));
    return;
  }
  await showViews(views, plots, { entry, axes, page, signal });
}

/** Show the views, and then, since they have to be looked for first, their residuals. */
async function showViews(views, plots, { entry, axes, page, signal }) {
  const run = entry.run_id;
  const get = (path) => page.api.get(path, { signal });
  fill(plots, h("p", { class: "empty", role: "status" }, "Looking for the target in all pictures …"));
  try {
    const { views: found } = await get(`runs/${run}/views?calibration=${entry.id}`);
    const solve = (leaveOut, tell) => solveAgain({ entry, leaveOut, page, signal, tell });
    const take = mountViews(fill(views), { run, views: found, axes, page, signal, solve });
    const residuals = await get(`calibrations/${entry.id}/residuals`);
    take(residuals);
    mountPlots(plots, residuals, signal);
  } catch (error) {
    if (error.name === "AbortError") throw error;
    const sentence = h("p", { class: "problem", role: "alert" }, error.message);
    fill(views.querySelector("table") ? plots : views, sentence);
    if (!views.querySelector("table")) fill(plots);
  }
}

/** Fill `element` with both plots of residuals, and the choice of what is in them. */
function mountPlots(element, residuals, signal) {
  const joints = [...new Set(residuals.views.map((view) => view.joint))];
  const choices = [
    ["all views", () => true],
    ["views of the fit", (view) => view.use === "fit" && !view.set_aside],
    ["held-out views", (view) => view.use === "verify"],
    ...joints.map((joint) => [`views of ${movedBy(joint)}`, (view) => view.joint === joint]),
  ].filter(([, has]) => residuals.views.some(has));
  const choice = h("select", { id: "residuals-of" }, ...choices.map(([name], i) => h("option", { value: i }, name)));
  const direction = h("canvas", { role: "img" });
  const place = h("canvas", { role: "img" });
  const directionWords = h("figcaption", {});
  const placeWords = h("figcaption", {});
  fill(
    element,
    h("p", { class: "choice" }, h("label", { for: "residuals-of" }, "Show "), choice),
    h("figure", {}, h("h3", {}, "By direction"), direction, directionWords),
    h("figure", {}, h("h3", {}, "By place in the picture"), place, placeWords),
  );

  function draw() {
    const points = pointsOf(residuals.views.filter(choices[Number(choice.value)][1]));
    const size = { width: residuals.width ?? 1, height: residuals.height ?? 1 };
    const times = magnification(points, size.width);
    drawByDirection(direction, points);
    drawByPlace(place, points, size, times);
    const { count, rms, meanX, meanY } = summaryOf(points);
    const digits = digitsOf(rms);
    const towards = (mean, more, less) => `${quantity(Math.abs(mean), "px", digits)} ${mean < 0 ? less : more}`;
    const mean = `${towards(meanX, "to the right", "to the left")} and ${towards(meanY, "down", "up")}`;
    const off = `${count} points, rms ${quantity(rms, "px", digits)}; on average ${mean}`;
    fill(directionWords, `${off}. A round cloud around the middle is noise; a long one, or clumps, is what the calibration does not describe.`);
    fill(placeWords, `Arrows are ${times.toLocaleString()} times as long as the residuals. Ones that swirl, or grow to the borders, tell of the lens.`);
    direction.setAttribute("aria-label", `Residuals by direction: ${off}`);
    place.setAttribute("aria-label", `Residuals by place in the picture: ${count} points`);
  }

  choice.addEventListener("change", draw);
  window.addEventListener("resize", draw, { signal });
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw, { signal });
  draw();
}

/** Solve a run's views again without some of them, tell how it goes, and show what is found beside what was. */
async function solveAgain({ entry, leaveOut, page, signal, tell }) {
  const run = entry.run_id;
  const ended = new Promise((resolve, reject) => {
    const follow = async ({ detail: event }) => {
      if (event.run_id !== run) return;
      if (event.type === "solving") tell(`${sentenceOf(event.message).slice(0, -1)} …`);
      if (event.type !== "finished") return;
      // After a reconnection earlier ends are told again: the run itself says whether it is over.
      const record = await page.api.get(`runs/${run}`, { signal }).catch(reject);
      if (record && record.state !== "running") resolve(record);
    };
    page.live.addEventListener("event", follow, { signal });
  });
  await page.attempt(async () => {
    tell("Solving …");
    try {
      await page.api.post(`runs/${run}/solve`, { leave_out: leaveOut });
      const record = await ended;
      tell("");
      if (record.error !== null) throw new Problem({ detail: record.error });
      location.hash = `#/judge/${record.calibration_id}/${entry.id}`;
    } catch (error) {
      tell("");
      throw error;
    }
  });
}

/** Return all calibrations, each to be shown or compared with the one that is. */
function history(entries, id, other) {
  const rows = entries.map((each) => [
    each.id === id ? h("strong", {}, moment(each.created_at)) : h("a", { href: `#/judge/${each.id}` }, moment(each.created_at)),
    [judgementOf(each), each.active ? [" ", h("span", { class: "remark" }, "in use")] : null],
    groundsOf(each),
    each.id === id
      ? "shown above"
      : each.id === other
        ? h("a", { href: `#/judge/${id}` }, "End the comparison")
        : h("a", { href: `#/judge/${id}/${each.id}`, "aria-label": `Compare with the one of ${moment(each.created_at)}` }, "Compare"),
  ]);
  return table("Calibrations, the newest first", ["Made", "Judgement", "Verdict", "Compare"], rows);
}
