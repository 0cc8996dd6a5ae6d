/** Two calibrations side by side: the verdicts, whether they say the same, and what differs most. */

import { fill, h, table } from "./elements.js";
import { labelOf, shown } from "./paper_tables.js";
import { number, quantity } from "./units.js";
import { activation, digitsOf, takeAway, verdict } from "./verdict.js";

/** Parameters that are listed. */
const MOST = 10;

/** Fill `element` with the calibration `entry` beside `other`; both as `GET /calibrations/{id}` has them. */
export async function mountComparison(element, { entry, other, page, signal, done }) {
  const card = (title, each) =>
    h("article", { class: "card", "aria-label": title }, h("h3", {}, title), verdict(each), facts(each), activation(each, page, signal, done), takeAway(each));
  const cards = h("div", { class: "side-by-side" }, card("This one, shown below", entry), card("The other", other));
  const words = h("p", { role: "status" }, "Comparing …");
  fill(element, cards, words);
  let found;
  try {
    found = await page.api.get(`calibrations/${other.id}/compare/${entry.id}`, { signal });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    fill(words, error.message);
    return;
  }
  fill(words, `${found.sentence}.`);
  words.classList.add("sentence");
  fill(element, words, cards, h("details", {}, h("summary", {}, "What differs, in numbers"), poseTable(found), parameterTable(found.parameters)));
}

function facts({ calibration }) {
  const { quality } = calibration;
  const px = (value) => quantity(value, "px", digitsOf(value));
  const left = quality.views.filter((view) => view.use === "none").map((view) => view.view);
  const rows = [
    ["Held-out views predicted to", px(quality.held_out_rms_px)],
    ["Residual of the fit", px(quality.rms_px)],
    ["Left out by hand", left.length ? left.map((number) => `view ${number}`).join(", ") : "no view"],
  ];
  return h("dl", { class: "facts" }, ...rows.map(([what, value]) => h("div", {}, h("dt", {}, what), h("dd", {}, value))));
}

function poseTable({ poses, poses_apart_from_world: apart }) {
  const values = ({ position_mean_m, position_max_m, rotation_mean_rad, rotation_max_rad }) =>
    [position_mean_m, position_max_m, rotation_mean_rad, rotation_max_rad].map((value) => 1000 * value);
  const digits = values(poses).map((value, i) => digitsOf(Math.max(value, values(apart)[i])));
  const columns = ["The camera’s pose", "Position (mm)", "at most (mm)", "Rotation (mrad)", "at most (mrad)", "In standard deviations"];
  const row = (name, found) => [
    name,
    ...values(found).map((value, i) => number(value, digits[i])),
    number(found.stds, 2),
  ];
  const numeric = columns.map((title, i) => (i ? { title, number: true } : title));
  return table("Difference over the range that both have", numeric, [
    row("in the world", poses),
    row("apart from where the target stood", apart),
  ]);
}

function parameterTable(parameters) {
  const sorted = parameters.filter((each) => each.stds !== null).sort((a, b) => b.stds - a.stds);
  const numeric = (title) => ({ title, number: true });
  const columns = ["Parameter", numeric("The other"), numeric("This one"), numeric("Difference"), numeric("± 1 std"), "Unit", numeric("In stds")];
  const rows = sorted.slice(0, MOST).map((each) => {
    const [owner, ...entry] = each.name.split(".");
    const [first, , unit] = shown(each.first, each.std, each.unit);
    const [second] = shown(each.second, each.std, each.unit);
    const [difference, std] = shown(each.difference, each.std, each.unit);
    return [`${owner}: ${labelOf(entry.join("."))}`, first, second, difference, std, unit, number(each.stds, 2)];
  });
  return table("Parameters that differ most, in standard deviations", columns, rows);
}
