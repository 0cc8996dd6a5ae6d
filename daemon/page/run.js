/** A run: how far it is, and what it has found. The latest is followed as it goes on, also when it began long before. */

import { address } from "./api.js";
import { fill, h, setText } from "./elements.js";
import { USES } from "./plan.js";
import { Progress } from "./progress.js";
import { clock, duration, sentenceOf } from "./units.js";
import { mountViews } from "./view_wall.js";

/** Fill `element` with the run `id`. */
export async function mountRun(element, page, signal, id) {
  const isLatest = page.live.state.run?.id === id;
  const run = isLatest ? page.live.state.run : await page.api.get(`runs/${encodeURIComponent(id)}`, { signal });
  const events = isLatest ? page.live.events.filter(({ run_id }) => run_id === id) : await pastEvents(id, signal);
  const plan = await page.api.get("runs/plan", { signal }).catch(() => ({ positions: [] }));
  if (signal.aborted) return;

  const panel = (name) => h("section", { class: `panel ${name}`, "aria-labelledby": `${name}-title` });
  const [result, advance, warnings, views] = ["result", "advance", "warnings", "taken"].map(panel);
  fill(element, result, advance, warnings, views);
  const parts = [
    mountResult(result, page, run),
    mountAdvance(advance, page, signal, run, plan.positions),
    mountWarnings(warnings),
  ];
  const wall = mountViews(views, page, signal, id);
  const progress = new Progress(events);

  let drawing = null;
  function draw() {
    drawing ??= requestAnimationFrame(() => {
      drawing = null;
      for (const follow of parts) follow(progress);
    });
  }

  for (const event of events) wall.tell(event);
  wall.look();
  draw();
  if (!isLatest) return;
  const told = events.at(-1)?.sequence ?? 0;
  for (const event of page.live.events) if (event.run_id === id && event.sequence > told) take(event);
  page.live.addEventListener("event", ({ detail }) => detail.run_id === id && take(detail), { signal });
  page.follow(draw, signal);

  function take(event) {
    progress.tell(event);
    wall.tell(event);
    if (["view", "solved", "finished"].includes(event.type)) wall.look();
    draw();
  }
}

/** Return the events of a run that is over: the stream of them ends by itself. */
async function pastEvents(id, signal) {
  const answer = await fetch(address(`runs/${encodeURIComponent(id)}/events`), { signal });
  if (!answer.ok) return [];
  const lines = (await answer.text()).split("\n");
  return lines.filter((line) => line.startsWith("data: ")).map((line) => JSON.parse(line.slice(6)));
}

/** How far the run is, and what steers it. Returns what shows it. */
function mountAdvance(element, page, signal, run, positions) {
  const what = h("p", { class: "words", role: "status" });
  const left = h("p", { class: "left" });
  const bar = h("progress", { max: "1", value: "0", "aria-label": "Positions taken" });
  const sweeps = h("div", { class: "sweeps" });
  const button = (text, act) => h("button", { type: "button", onclick: () => page.attempt(() => act()) }, text);
  const post = (act) => page.api.post(`runs/${encodeURIComponent(run.id)}/${act}`);
  let asked = false; // a pause comes after the view in flight
  const pause = button("Pause", async () => {
    await post("pause");
    asked = true;
    pause.disabled = true;
    setText(pause, "Pausing …");
  });
  const resume = button("Resume", () => post("resume"));
  const cancel = button("Cancel", () => post("cancel"));
  const controls = h("fieldset", { class: "bare" }, h("div", { class: "buttons" }, pause, resume, cancel));
  const note = [`Started at ${clock(run.created_at)}`, run.owner && ` by ${run.owner}`, run.note && `: “${run.note}”`];
  const head = h("div", { class: "panel-head" }, h("h2", { id: "advance-title" }, "Calibration run"), h("p", { class: "hint" }, note));
  fill(element, head, h("div", { class: "advance-line" }, what, left), bar, sweeps, controls);
  page.guard(controls, signal, () => page.obstacle("operate"));

  const groups = groupsOf(positions);
  const rows = groups.map(row);
  fill(sweeps, ...rows.map((each) => each.element));

  return (progress) => {
    const { over, state, phase } = progress;
    const isPaused = state === "paused";
    element.hidden = over && state === "succeeded";
    controls.hidden = over;
    if (isPaused || over) asked = false;
    pause.hidden = isPaused || !["homing", "measuring"].includes(phase); // where it computes, nothing rests
    pause.disabled = asked;
    setText(pause, asked ? "Pausing …" : "Pause");
    resume.hidden = !isPaused;
    setText(what, sentence(progress));
    const share = progress.of ? Math.max(0, progress.position - (over ? 0 : 1)) / progress.of : 0;
    bar.value = phase === "solving" ? 1 : share;
    const now = Date.parse(page.live.state?.time ?? progress.end?.time);
    const isMeasuring = !over && phase === "measuring" && positions.length === progress.of;
    const place = progress.of ? `Position ${progress.position} of ${progress.of}` : "";
    const timed = () => `${place}, about ${duration(progress.timeLeft(positions, now))} left`;
    setText(left, isMeasuring ? timed() : phase === "solving" && !over ? progress.solving : place);
    const fits = progress.of === 0 || positions.length === progress.of; // another profile has other positions
    sweeps.hidden = !fits;
    for (const each of rows) each.follow(progress);
  };
}

function sentence({ over, end, state, phase, joint }) {
  if (over) return { succeeded: "Finished.", failed: "Failed.", cancelled: "Cancelled.", interrupted: "Interrupted." }[end.state];
  if (state === "paused") return "Paused: all axes stand.";
  if (phase === "homing") return `Homing ${joint}.`;
  if (phase === "measuring") return joint === null ? "All axes move, to verify the whole chain." : `Measuring: ${joint} moves alone.`;
  if (phase === "solving") return "Computing the calibration.";
  return "Beginning.";
}

/** Return the plan's positions by joint and use, in their order. */
function groupsOf(positions) {
  const groups = new Map();
  for (const { position, joint, use } of positions) {
    const key = `${use} ${joint}`;
    if (!groups.has(key)) groups.set(key, { joint, use, positions: [] });
    groups.get(key).positions.push(position);
  }
  return [...groups.values()];
}

/** A joint's positions, each a mark. */
function row({ joint, use, positions }) {
  const marks = positions.map(() => h("i", {}));
  const count = h("span", { class: "count" });
  const name = joint ?? "all axes";
  const element = h(
    "div",
    { class: "sweep" },
    h("span", {}, h("strong", {}, name), h("span", { class: "hint" }, ` ${USES[use]}`)),
    h("span", { class: "marks", "aria-hidden": "true" }, ...marks),
    count,
  );
  return {
    element,
    follow(progress) {
      const states = positions.map((position) => progress.at(position));
      states.forEach((state, i) => {
        if (marks[i].dataset.state !== state) marks[i].dataset.state = state;
      });
      const taken = states.filter((state) => state === "taken").length;
      const unseen = states.filter((state) => state === "unseen").length;
      setText(count, `${taken} of ${positions.length}${unseen ? `, ${unseen} without the target` : ""}`);
    },
  };
}

function mountWarnings(element) {
  const list = h("ul", { class: "faults" });
  fill(element, h("h2", { id: "warnings-title" }, "Warnings"), h("div", { role: "log" }, list));
  element.hidden = true;
  return ({ warnings }) => {
    element.hidden = warnings.length === 0;
    for (const message of warnings.slice(list.children.length)) list.append(h("li", {}, sentenceOf(message)));
  };
}

/** How the run has ended: the verdict, or why there is none and what can be done. */
function mountResult(element, page, run) {
  let shown = null;
  element.hidden = true;
  return (progress) => {
    element.hidden = !progress.over;
    const now = JSON.stringify([progress.end, page.obstacle("move"), page.live.state?.rig.calibration_id]);
    if (!progress.over || now === shown) return;
    shown = now;
    fill(element, progress.end.state === "succeeded" ? verdict(page, progress) : unfinished(page, run, progress));
  };
}

function verdict(page, { end, quality }) {
  const isActive = page.live.state?.rig.calibration_id === end.calibration_id;
  return [
    h("h2", { id: "result-title" }, "Verdict"),
    h("p", { class: "verdict", role: "status", "data-judgement": quality?.judgement }, said(quality)),
    isActive && h("p", {}, "In use: poses are computed from it."),
    h("div", { class: "buttons" }, judgeLink(end.calibration_id), again()),
  ];
}

function unfinished(page, run, { end, quality }) {
  const act = (what, text) => {
    const work = async () => {
      await page.api.post(`runs/${encodeURIComponent(run.id)}/${what}`);
      location.hash = "#/calibrate";
    };
    return h("button", { type: "button", onclick: () => page.attempt(work) }, text);
  };
  const resume = act("resume", "Take it up again");
  resume.classList.add("primary");
  const solve = act("solve", "Solve it as it is");
  const [toMove, toSolve] = [page.obstacle("move"), page.obstacle("operate")];
  resume.disabled = toMove !== null;
  solve.disabled = toSolve !== null;
  const solved = end.calibration_id !== null;
  // A cancelled run's error says no more than its state, unless its axes could not be seen to stand.
  const why = end.error === "it was cancelled" ? "Somebody asked for it." : sentenceOf(end.error ?? end.state);
  const words = { failed: "The run failed", cancelled: "The run was cancelled", interrupted: "The run was interrupted" };
  return [
    h("h2", { id: "result-title" }, words[end.state]),
    h("p", { role: "status" }, why),
    solved && h("p", { class: "verdict", "data-judgement": quality?.judgement }, said(quality)),
    h("p", { class: "hint" }, "Taken up again, it homes all axes and goes on with the first sweep that is not finished. Its views can be solved as far as they go."),
    toMove !== null && h("p", { class: "reason" }, toMove),
    h("div", { class: "buttons" }, resume, solve, solved && judgeLink(end.calibration_id), again()),
  ];
}

function said(quality) {
  return quality?.verdict ? sentenceOf(quality.verdict) : "What it has measured is solved.";
}

function judgeLink(calibrationId) {
  return h("a", { class: "button primary", href: `#/judge/${calibrationId}` }, "Judge this calibration");
}

function again() {
  return h("a", { class: "button", href: "#/calibrate/new" }, "Prepare another run");
}
