/** What a calibration is worth: the verdict in one sentence, and the figures that it rests on. */

import { h, table } from "./elements.js";
import { moment, number, quantity, sentenceOf } from "./units.js";

const WORDS = { good: "Good", usable: "Usable", poor: "Poor", unknown: "Unknown" };

/** Return a calibration's judgement as a word. */
export function judgementOf(entry) {
  const word = WORDS[entry.judgement] ?? "Not judged";
  return h("strong", { class: "judgement", "data-judgement": entry.judgement ?? "unknown" }, word);
}

/** Return the sentence that the judgement rests on, without the word itself. */
export function groundsOf(entry) {
  return sentenceOf((entry.verdict ?? "nobody has judged it").replace(/^(Good|Usable|Poor|Unknown): /, ""));
}

/** Return the judgement of a calibration as a heading's worth of it: word, sentence, and which one it is. */
export function verdict(entry) {
  const shown = { class: "verdict", "data-judgement": entry.judgement };
  return [h("p", shown, judgementOf(entry), " ", groundsOf(entry)), h("p", { class: "hint" }, nameOf(entry))];
}

/** Return in words which calibration this is. */
export function nameOf(entry) {
  return `Made ${moment(entry.created_at)}, ${entry.method === "ml" ? "by maximum likelihood" : "in closed form"}`;
}

/** Return a button that has poses computed from a calibration, in a fieldset that is disabled for who may not. */
export function activation(entry, page, signal, done) {
  if (entry.active) return h("p", { class: "active" }, "In use: poses are computed from it.");
  const activate = () =>
    page.attempt(async () => {
      await page.api.post(`calibrations/${entry.id}/activate`);
      page.tell("Poses are computed from this calibration now.");
      await done();
    });
  const button = h("button", { type: "button", class: "primary", onclick: activate }, "Use this calibration");
  const fieldset = h("fieldset", { class: "bare" }, button);
  page.guard(fieldset, signal, () => page.obstacle("operate"));
  return fieldset;
}

/** Return where a calibration is taken away from. */
export function takeAway(entry) {
  return h("p", {}, h("a", { href: `#/takeaway/${entry.id}` }, "Take it away"), " as a report, a URDF, or what ROS and OpenCV read");
}

/** Return predicted against measured: the figures of the fit and of held-out views, in all and by joint. */
export function figures(quality) {
  const by = quality.held_out_by === "leave_one_view_out" ? "each view, by all others" : "held-out views";
  const px = (value) => quantity(value, "px", digitsOf(value));
  const facts = [
    [`Prediction of ${by}`, px(quality.held_out_rms_px)],
    ["What noise explains of that", px(quality.predicted_px)],
    ["Residual of the fit", px(quality.rms_px)],
    ["Camera’s position known to", millis(quality.position_std_m, "mm")],
    ["Camera’s rotation known to", millis(quality.rotation_std_rad, "mrad")],
  ];
  const joints = quality.joints ?? [];
  const digits = digitsOf(Math.max(...joints.flatMap((joint) => [joint.rms_px, joint.held_out_px])));
  const rows = joints.map((joint) => [
    movedBy(joint.joint),
    String(joint.views),
    number(joint.rms_px, digits),
    number(joint.held_out_px, digits),
  ]);
  const numeric = (title) => ({ title, number: true });
  const columns = ["Moved", numeric("Views of the fit"), numeric("Their residual (px)"), numeric("Held-out views (px)")];
  return [
    h("dl", { class: "facts" }, ...facts.map(([what, value]) => h("div", {}, h("dt", {}, what), h("dd", {}, value)))),
    table("Error by joint (rms)", columns, rows),
  ];
}

/** Return what would help most: the calibration's own warnings, and what was corrected. */
export function advice(quality) {
  const missing = (quality.coverage ?? []).flatMap((camera) => camera.missing ?? []);
  const sentences = [...quality.warnings, ...missing];
  const list = (texts) => h("ul", { class: "sentences" }, ...texts.map((text) => h("li", {}, sentenceOf(text))));
  return [
    sentences.length ? list(sentences) : h("p", { class: "empty" }, "Nothing is badly known: more views would only make what is known a little surer."),
    quality.corrections?.length ? [h("h3", {}, "Taken into account"), list(quality.corrections.map((text) => text.replace(/, taken into account$/, "")))] : null,
  ];
}

/** Return what moves in a view, by the joint that moves alone; null where none does. */
export function movedBy(joint) {
  return joint ?? "all axes";
}

/** Return how many digits of a small number mean something: three. */
export function digitsOf(value) {
  if (!value || !Number.isFinite(value)) return 3;
  return Math.min(6, Math.max(0, 2 - Math.floor(Math.log10(Math.abs(value)))));
}

function millis(spread, unit) {
  if (!spread) return "–";
  const mean = 1000 * spread.mean;
  const worst = 1000 * spread.max;
  const digits = digitsOf(worst);
  return `${quantity(mean, unit, digits)} (at worst ${quantity(worst, unit, digits)})`;
}
