/** What a calibration can be taken away as: `#/takeaway` the one in use, or else the newest; `#/takeaway/ID` another. */

import { address } from "./api.js";
import { fill, h } from "./elements.js";
import { bytes, moment, sentenceOf } from "./units.js";

export async function mount(element, page, { signal, path: [chosen] }) {
  const calibrations = await page.api.get("calibrations", { signal });
  const panel = h("section", { class: "panel", "aria-labelledby": "takeaway" }, h("h2", { id: "takeaway" }, "Take away"));
  fill(element, panel);
  if (!calibrations.length) {
    const words = "Nothing is calibrated yet: the first calibration run makes what can be taken away.";
    panel.append(h("p", { class: "empty" }, words), h("p", {}, h("a", { class: "button", href: "#/calibrate/new" }, "Prepare a run")));
    return;
  }
  const { id } = calibrations.find((each) => each.id === chosen) ?? calibrations.find((each) => each.active) ?? calibrations[0];
  const options = calibrations.map((each) => h("option", { value: each.id, selected: each.id === id }, named(each)));
  const go = (event) => (location.hash = `#/takeaway/${event.target.value}`);
  const choice = h("select", { id: "takeaway-of", onchange: go }, ...options);
  const list = h("ul", { class: "exports", "aria-label": "Files" });
  panel.append(
    h("p", { class: "choice" }, h("label", { for: "takeaway-of" }, "Calibration "), choice),
    list,
  );
  const exports = await page.api.get(`calibrations/${id}/exports`, { signal });
  fill(list, ...exports.map((each) => h("li", {}, ...entry(id, each))));
}

function named(calibration) {
  const words = [moment(calibration.created_at), calibration.judgement, calibration.active && "in use"];
  return words.filter(Boolean).join(", ");
}

function entry(id, { name, purpose, size, notes, problem }) {
  const file = `calibrations/${id}/exports/${encodeURIComponent(name)}`;
  const title = problem === null ? h("a", { href: address(file), download: "" }, name) : h("span", { class: "muted" }, name);
  const weight = size === null ? "made when asked for, in seconds" : bytes(size);
  return [
    h("p", {}, title, problem === null && h("span", { class: "size" }, weight)),
    h("p", {}, ...coded(sentenceOf(purpose))),
    ...notes.map((note) => h("p", { class: "hint" }, `${note}.`)),
    problem === null ? null : h("p", { class: "hint" }, `It cannot be had: ${problem}.`),
  ];
}

/** Return a text in which `what is between backticks` is code. */
function coded(text) {
  return text.split("`").map((part, i) => (i % 2 ? h("code", {}, part) : part));
}
