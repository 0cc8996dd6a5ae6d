/**
 * Calibrating: what is looked at before a run, and the run. `#/calibrate` is the latest run, and what comes before one
 * where there is none; `#/calibrate/new` prepares another one, `#/calibrate/ID` is a run of the past.
 */

import { within } from "./again.js";
import { Problem } from "./api.js";
import { fill, h } from "./elements.js";
import { mountPreparation } from "./preparation.js";
import { mountRun } from "./run.js";

const NEW = "new";

export function mount(element, page, { signal, path }) {
  let shown = null;
  let inner = null;
  fill(element, h("p", { class: "empty" }, "Waiting for the daemon."));

  page.follow((state) => {
    if (state === null) return; // what is shown stays, and the header says that it is not up to date
    const latest = state.run?.id;
    const id = state.rig.run ?? path[0] ?? latest ?? NEW;
    const what = `${id} ${id === latest}`;
    if (what === shown) return;
    shown = what;
    inner?.abort();
    inner = within(signal);
    fill(element);
    if (id === NEW) mountPreparation(element, page, inner.signal);
    else mountRun(element, page, inner.signal, id).catch(tell);
  }, signal);

  function tell(error) {
    if (error.name === "AbortError") return;
    fill(element, h("p", { class: "problem", role: "alert" }, error.message));
    if (!(error instanceof Problem)) throw error;
  }
}
