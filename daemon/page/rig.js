/** The rig: what its camera sees, and its axes. */

import { fill, h } from "./elements.js";
import { mountAxes } from "./axes.js";
import { mountPicture } from "./picture.js";

export function mount(element, page, { signal }) {
  const picture = h("section", { class: "panel picture", "aria-labelledby": "picture-title" });
  const axes = h("section", { class: "panel axes", "aria-labelledby": "axes-title" });
  fill(element, picture, axes);
  mountPicture(picture, page, signal);
  mountAxes(axes, page, signal);
}
