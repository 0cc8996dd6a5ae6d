/** The plan: where a run would go, how long that takes, and whose sweep starts from here. */

import { fill, h, setText, table } from "./elements.js";
import { sweepChart } from "./sweep_chart.js";
import { duration, reading } from "./units.js";

/** What the views of a sweep are for, in words. */
export const USES = { fit: "to calibrate from", verify: "to verify by" };

/**
 * Fill `element`; returns what looks again, the joints whose sweep starts from here, and how long all takes.
 * @param {() => void} changed Called when another joint is to start from here.
 */
export function mountPlan(element, page, signal, changed) {
  const outline = h("p", {});
  const charts = h("div", { class: "charts" });
  const legend = h(
    "p",
    { class: "hint legend" },
    h("span", {}, "From left to right, position by position:"),
    h("span", { class: "dot fit" }, "moves, to calibrate from"),
    h("span", { class: "dot verify" }, "moves, to verify by"),
    h("span", { class: "dot standing" }, "stands still"),
  );
  const sweeps = h("div", {});
  const choices = h("div", { class: "choices" });
  const problem = h("p", { class: "problem", role: "alert" });
  const fromHere = h(
    "fieldset",
    { class: "bare" },
    h("legend", {}, "Start a joint’s sweep from where the other axes stand now"),
    choices,
    problem,
  );
  fill(element, h("h2", { id: "plan-title" }, "Plan"), outline, charts, legend, sweeps, fromHere);
  const plan = { seconds: null, fromHere: [], look };
  let shown = null;

  async function look(query) {
    try {
      show(await page.api.get(`runs/plan?${query}`, { signal }));
    } catch (error) {
      if (error.name === "AbortError") throw error;
      setText(problem, error.message);
    }
  }

  function show(document) {
    const { views, seconds, joints, positions } = document;
    plan.seconds = seconds;
    setText(problem, "");
    const { axes } = page.live.state?.rig ?? { axes: [] };
    const now = JSON.stringify([positions, axes.map(({ position, tolerance }) => Math.round(position / tolerance))]);
    if (now === shown || !axes.length) return;
    shown = now;
    setText(outline, `${views} positions, about ${duration(seconds)}, besides homing and computing.`);
    fill(charts, ...axes.map((axis, i) => sweepChart(axis, i, positions)));
    fill(sweeps, sweepTable(axes, positions));
    if (!choices.children.length) fill(choices, ...joints.map(choice));
  }

  function choice(joint) {
    const input = h("input", { type: "checkbox" });
    input.addEventListener("change", () => {
      plan.fromHere = input.checked ? [...plan.fromHere, joint] : plan.fromHere.filter((each) => each !== joint);
      changed();
    });
    return h("label", {}, input, ` ${joint}`);
  }

  return plan;
}

function sweepTable(axes, positions) {
  const columns = ["Moves", "For", { title: "Positions", number: true }, "From – to", "Others stand at", { title: "About", number: true }];
  const rows = sweepsOf(positions).map(({ joint, use, members }) => {
    const moving = axes.findIndex(({ name }) => name === joint);
    const at = (index, member) => reading(member.readings[index], axes[index]);
    const others = axes.flatMap(({ name }, i) => (i === moving ? [] : [`${name} ${at(i, members[0])}`]));
    const all = joint === null;
    return [
      joint ?? "all axes",
      USES[use],
      members.length,
      all ? "–" : `${at(moving, members[0])} – ${at(moving, members.at(-1))}`,
      all ? "–" : others.join(", ") || "–",
      duration(members.reduce((sum, { seconds }) => sum + seconds, 0)),
    ];
  });
  return table("The sweeps, in their order", columns, rows);
}

/** Return the plan's positions by sweep: those that follow each other with the same joint, from the same start. */
function sweepsOf(positions) {
  const sweeps = [];
  let before = null;
  for (const position of positions) {
    const { joint, use, readings } = position;
    // With one joint moving, one reading differs at the most.
    const differing = before === null ? Infinity : readings.filter((each, i) => each !== before.readings[i]).length;
    const goesOn = before !== null && before.joint === joint && before.use === use && (joint === null || differing <= 1);
    if (goesOn) sweeps.at(-1).members.push(position);
    else sweeps.push({ joint, use, members: [position] });
    before = position;
  }
  return sweeps;
}
