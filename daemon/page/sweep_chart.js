/** A small chart of one axis: where it stands at each position of the plan, between its limits. */

import { h, svg } from "./elements.js";
import { measureOf, number, reading } from "./units.js";

const WIDTH = 360;
const HEIGHT = 84;
const EDGE = 8;

/**
 * Return the chart of an axis.
 * @param {Object} axis As the API describes it.
 * @param {number} index Its place in the chain.
 * @param {Array} positions The plan's.
 */
export function sweepChart(axis, index, positions) {
  const [low, high] = axis.limits;
  const across = (i) => EDGE + ((WIDTH - 2 * EDGE) * (i + 0.5)) / positions.length;
  const up = (value) => HEIGHT - EDGE - ((HEIGHT - 2 * EDGE) * (value - low)) / (high - low);
  const level = (value, name) => svg("line", { x1: 0, x2: WIDTH, y1: up(value), y2: up(value), class: name });
  const dots = positions.map(({ joint, use, readings }, i) => {
    const moves = joint === null || joint === axis.name;
    const place = { cx: across(i).toFixed(1), cy: up(readings[index]).toFixed(1) };
    return svg("circle", { ...place, r: moves ? 3 : 1.5, class: moves ? use : "standing" });
  });
  const moved = positions.filter(({ joint }) => joint === null || joint === axis.name).map(({ readings }) => readings[index]);
  const at = (value) => reading(value, axis);
  const { factor, digits } = measureOf(axis);
  const between = `${number(low * factor, digits)} to ${at(high)}`;
  const span = moved.length ? `from ${at(Math.min(...moved))} to ${at(Math.max(...moved))}` : "not moved";
  return h(
    "figure",
    { class: "chart" },
    h("figcaption", {}, h("strong", {}, axis.name), ` ${span}`),
    svg(
      "svg",
      { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": `${axis.name}: ${span}, within ${between}` },
      level(low, "limit"),
      level(high, "limit"),
      axis.homed && axis.position !== null ? level(Math.min(high, Math.max(low, axis.position)), "now") : null,
      dots,
    ),
    h("p", { class: "hint ends" }, h("span", {}, `limits ${between}`), axis.homed && h("span", {}, `now ${at(axis.position)}`)),
  );
}
