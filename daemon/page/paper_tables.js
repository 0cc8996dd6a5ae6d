/** The paper's tables 1 to 4 for this rig, and all parameters with their standard deviations. */

import { h, table } from "./elements.js";
import { number, reading } from "./units.js";

const DEGREES = 180 / Math.PI;
const LABELS = {
  scale: "scale",
  a_prev: "distance to the axis before",
  alpha_prev: "angle to the axis before",
  d_offset: "offset along the axis, at reading 0",
  theta_offset: "angle about the axis, at reading 0",
  half_gap: "half the backlash",
  aspect: "aspect of the given poses",
  fx: "focal length, x",
  fy: "focal length, y",
  cx: "principal point, x",
  cy: "principal point, y",
};

/** Return tables 1 to 4; what is held out tells, and without any a sentence says so. */
export function paperTables({ verified, travel, prediction }, axes) {
  if (verified === null) return h("p", { class: "empty" }, "No view was held out, so that there is nothing to verify by: mark sweeps with use = \"verify\".");
  if (!travel.length && !prediction.length) {
    return h("p", { class: "empty" }, "No joint moved alone in the held-out views, so that these tables have no rows: give each joint a sweep with use = \"verify\".");
  }
  return [...travel.map((each) => travelTable(each, axes)), ...prediction.map((each) => predictionTable(each, axes))];
}

function travelTable(found, axes) {
  const straight = found.kind === "prismatic";
  const [far, fine] = straight ? ["mm", "mm"] : ["°", "mrad"];
  const travel = (value) => number(value * (straight ? 1000 : DEGREES), straight ? 1 : 2);
  const error = (value) => (value === null ? "–" : number(1000 * value, 4));
  const percent = (value) => (value === null ? "–" : number(value, 4));
  const trusted = found.rows.some((row) => row.encoder !== null);
  const columns = [
    numeric(`Travel (${far})`),
    numeric(`Off the pictures (${fine})`),
    numeric("%"),
    numeric(`Known to (${fine})`),
    ...(trusted ? [numeric(`Off the encoder (${fine})`), numeric("%")] : []),
    numeric(`Paper: travel (${far})`),
    numeric(`Paper: error (${fine})`),
    numeric("%"),
  ];
  const count = Math.max(found.rows.length, found.paper.length);
  const rows = Array.from({ length: count }, (_, i) => {
    const row = found.rows[i];
    const theirs = found.paper[i];
    const own = row ? [travel(row.predicted), error(row.error), percent(row.percent), std(row.std)] : ["", "", "", ""];
    const encoder = !trusted ? [] : row ? [error(row.encoder_error), percent(row.encoder_percent)] : ["", ""];
    const paper = theirs ? [travel(theirs.travel), error(theirs.error), percent(theirs.percent)] : ["", "", ""];
    return [...own, ...encoder, ...paper];
  });
  const start = found.start.map((value, i) => `${axes[i]?.name ?? ""} ${readingOf(value, axes[i])}`).join(", ");
  const caption = `Table ${found.number}: ${found.joint}, predicted travel against measured, from ${start}`;
  return table(caption, columns, rows);

  function std(value) {
    return value === null ? "–" : `± ${number(1000 * value, 4)}`;
  }
}

function predictionTable(found, axes) {
  const columns = [
    { title: "Readings" },
    numeric("Points"),
    numeric("Mean error (px)"),
    numeric("Known to (px)"),
    numeric("Paper (px)"),
  ];
  const count = Math.max(found.rows.length, found.paper.length);
  const rows = Array.from({ length: count }, (_, i) => {
    const row = found.rows[i];
    const paper = found.paper[i] === undefined ? "" : number(found.paper[i], 3);
    if (!row) return ["", "", "", "", paper];
    return [readings(row.readings, axes), String(row.points), number(row.mean_px, 3), row.std_px === null ? "–" : `± ${number(row.std_px, 3)}`, paper];
  });
  return table(`Table ${found.number}: image points after ${found.joint} moved, predicted against measured`, columns, rows);
}

/** Return all parameters: a table for each joint and camera, and the target where it is not flat. */
export function parameterTables(parameters) {
  const owners = new Map();
  for (const parameter of parameters) {
    const [owner, ...entry] = parameter.name.split(".");
    if (!owners.has(owner)) owners.set(owner, []);
    owners.get(owner).push({ ...parameter, entry: entry.join(".") });
  }
  const columns = ["Parameter", numeric("Value"), numeric("Standard deviation"), "Unit"];
  return [...owners].map(([owner, rows]) =>
    table(owner, columns, rows.map((row) => [labelOf(row.entry), ...shown(row.value, row.std, row.unit)])),
  );
}

/** Return what a parameter's entry, such as `point.x`, is called. */
export function labelOf(entry) {
  const [name, letter] = entry.split(".");
  if (name === "axis") return `axis, ${letter}`;
  if (name === "point") return `point of the axis, ${letter}`;
  if (name === "position") return `position at readings 0, ${letter}`;
  if (name === "once_per_turn") return `error once per turn, ${letter}`;
  if (name === "coupling") return `share of ${letter} that it follows`;
  if (name === "warp") return `height of the shape ${letter}`;
  return LABELS[entry] ?? entry.replaceAll("_", " ");
}

/** Return a value, its standard deviation, and their unit: mm and degrees, with as many digits as mean something. */
export function shown(value, std, unit) {
  const [factor, name] = unit === "m" ? [1000, "mm"] : unit === "rad" ? [DEGREES, "°"] : [1, unit === "deg" ? "°" : unit];
  const digits = std ? Math.min(9, Math.max(0, 1 - Math.floor(Math.log10(std * factor)))) : 6;
  if (std === 0) return [number(value * factor, 3), "as agreed", name]; // such as where an axis's zero is
  return [number(value * factor, digits), std === null ? "–" : number(std * factor, digits), name];
}

/** Return readings of all axes in a row, each with its unit. */
export function readings(values, axes) {
  return values.map((value, i) => readingOf(value, axes[i])).join(", ");
}

/** Return a reading of an axis; as a number where the rig has no such axis any more. */
function readingOf(value, axis) {
  return axis === undefined ? number(value, 2) : reading(value, axis);
}

function numeric(title) {
  return { title, number: true };
}

