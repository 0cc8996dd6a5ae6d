/** Before a run: what stands against it, what it would do, and the start. */

import { again } from "./again.js";
import { mountChecklist } from "./checklist.js";
import { fill, h, setText } from "./elements.js";
import { mountPicture } from "./picture.js";
import { mountPlan } from "./plan.js";
import { duration, moment, sentenceOf } from "./units.js";

/** Fill `element`; `signal` is aborted when a run begins. */
export function mountPreparation(element, page, signal) {
  const panel = (name) => h("section", { class: `panel ${name}`, "aria-labelledby": `${name}-title` });
  const [unfinished, checks, planned, start, picture] = ["unfinished", "checklist", "plan", "start", "picture"].map(panel);
  unfinished.hidden = true;
  fill(element, h("div", { class: "preparation" }, h("div", { class: "column" }, unfinished, checks), start, picture, planned));

  const checklist = mountChecklist(checks, page, signal);
  const plan = mountPlan(planned, page, signal, () => look());
  const about = mountStart(start, page, signal, plan);
  mountPicture(picture, page, signal);
  tellUnfinished(unfinished, page, signal);

  const look = again(
    async () => {
      const query = new URLSearchParams(plan.fromHere.map((joint) => ["from_here", joint]));
      await plan.look(query);
      await checklist.look(query);
      about(plan.seconds);
    },
    { signal },
  );
  let seen = null;
  page.follow((state) => {
    if (state === null || state.rig.moving) return;
    const { axes, stop, lease, devices, calibration_id } = state.rig;
    const standing = axes.map(({ name, homed, fault, lost, position, tolerance }) => [
      ...[name, homed, fault, lost],
      Math.round(position / tolerance),
    ]);
    const now = JSON.stringify([standing, stop.latched, lease?.owner, devices, calibration_id, state.problems]);
    if (now !== seen) look();
    seen = now;
  }, signal);
  picture.addEventListener("health", () => look(), { signal });
}

/** Fill `element` with the start; returns what is told how long the run will take. */
function mountStart(element, page, signal, plan) {
  const name = h("input", { id: "name", maxlength: "100", autocomplete: "name", value: page.name });
  name.addEventListener("change", () => (page.name = name.value));
  const note = h("input", { id: "note", maxlength: "1000", placeholder: "which target, what has changed" });
  const about = h("p", {});
  const form = h(
    "form",
    {},
    h(
      "fieldset",
      { class: "bare start-line" },
      page.you.key === null && h("div", { class: "name" }, h("label", { for: "name" }, "Your name"), name),
      h("div", { class: "note" }, h("label", { for: "note" }, "Note for the lab book"), note),
      h("button", { class: "primary" }, "Start the calibration"),
    ),
  );
  fill(element, h("h2", { id: "start-title" }, "Start"), about, form);
  page.guard(form.querySelector("fieldset"), signal);
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    page.attempt(async () => {
      await page.api.post("runs", { owner: page.owner, note: note.value, from_here: plan.fromHere });
      location.hash = "#/calibrate";
    });
  });
  return (seconds) => {
    const length = seconds === null ? "" : ` for about ${duration(seconds)}, then computes`;
    setText(about, `The rig homes what is not homed and moves by itself${length}. Keep clear of it; STOP ends it at once.`);
  };
}

/** Tell of the last run where it was cut off, as by a power cut. */
async function tellUnfinished(element, page, signal) {
  const runs = await page.api.get("runs", { signal }).catch(() => []);
  const last = runs[0];
  if (last === undefined || last.state === "succeeded" || last.calibration_id !== null) return;
  element.hidden = false;
  fill(
    element,
    h("h2", { id: "unfinished-title" }, "The last run was cut off"),
    h("p", {}, `${moment(last.created_at)}. ${sentenceOf(last.error ?? last.state)}`),
    h("p", {}, h("a", { href: `#/calibrate/${last.id}` }, "Take it up again, or solve it as it is")),
  );
}
