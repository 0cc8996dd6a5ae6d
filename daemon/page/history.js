/** All calibrations there are, the newest first. */

import { fill, h, table } from "./elements.js";
import { moment } from "./units.js";

export async function mount(element, page, { signal }) {
  const list = h("div", {});
  fill(element, h("section", { class: "panel", "aria-labelledby": "history-title" }, h("h2", { id: "history-title" }, "Calibrations"), list));

  async function show() {
    const calibrations = await page.api.get("calibrations", { signal });
    if (!calibrations.length) {
      fill(list, h("p", { class: "empty" }, "None yet: the first calibration run makes one."));
      return;
    }
    const rows = calibrations.map((each) => [moment(each.created_at), each.verdict, state(each)]);
    fill(list, table("Calibrations, the newest first", ["Made", "Verdict", "State"], rows));
  }

  function state(calibration) {
    if (calibration.active) return h("strong", {}, "Active");
    const activate = async () => {
      await page.api.post(`calibrations/${calibration.id}/activate`);
      await show();
    };
    const fieldset = h("fieldset", { class: "bare" }, h("button", { type: "button", onclick: () => page.attempt(activate) }, "Activate"));
    fieldset.disabled = page.obstacle("operate") !== null;
    return fieldset;
  }

  await show();
}
