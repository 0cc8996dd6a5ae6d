/** The rig: what its camera sees, its axes, and where everything is. */

import { fill, h } from "./elements.js";
import { mountAxes } from "./axes.js";
import { mountPicture } from "./picture.js";
import { mountScene } from "./scene.js";

export function mount(element, page, { signal }) {
  const picture = h("section", { class: "panel picture", "aria-labelledby": "picture-title" });
  const axes = h("section", { class: "panel axes", "aria-labelledby": "axes-title" });
  const scene = h("section", { class: "panel scene", "aria-labelledby": "scene-title" });
  fill(element, picture, axes, scene);
  mountPicture(picture, page, signal);
  mountAxes(axes, page, signal);
  mountScene(scene, page, signal);
}
