/** The rig in 3-D at its current readings, as the active calibration has it; and the same as a table. */

import { again } from "./again.js";
import { fill, h, setText, table } from "./elements.js";
import { draw, ends, enlargement, extent, origin } from "./scene_drawing.js";
import { SceneView, minus, plus, times } from "./scene_view.js";
import { number, quantity } from "./units.js";

/** Milliseconds between two scenes. */
const PAUSE = 200;
const STEP = Math.PI / 36;
const COLOURS = ["text", "muted", "accent", "warning", "good", "danger", "surface"];

/** Fill `element`. Nothing is asked for while it is out of sight. */
export function mountScene(element, page, signal) {
  const canvas = h("canvas", {
    tabindex: "0",
    role: "application",
    "aria-label": "The rig in 3-D; what it shows is in the table below",
    "aria-describedby": "scene-help",
  });
  const missing = h("p", { class: "empty" });
  const scale = h("p", { class: "hint" });
  const rows = h("div", {});
  const numbers = h("details", {}, h("summary", {}, "As a table"), rows);
  const button = (text, label, act) => h("button", { type: "button", "aria-label": label, onclick: act }, text);
  const controls = h(
    "div",
    { class: "group" },
    button("−", "Zoom out", () => change(() => view.zoom(1 / 1.25))),
    button("Fit", "Fit all into the picture", () => change(fit)),
    button("+", "Zoom in", () => change(() => view.zoom(1.25))),
  );
  const help = h("p", { id: "scene-help", class: "hint" }, "Drag or ← → ↑ ↓ turn it, + and − zoom, 0 fits. Frames: x red, y green, z blue.");
  const drawing = h("div", { class: "drawing", hidden: true }, h("div", { class: "scene-frame" }, canvas), scale, help, numbers);
  fill(element, h("div", { class: "panel-head" }, h("h2", { id: "scene-title" }, "Rig in 3-D"), controls), missing, drawing);

  const view = new SceneView();
  let scene = null;
  let enlarged = null;
  let isSeen = false;
  let asked = null;
  let fitted = null; // the size of the frame

  const look = again(
    async () => {
      const id = page.live.state?.rig.calibration_id;
      if (!id || !isSeen || document.hidden) return;
      try {
        const found = await page.api.get(`calibrations/${id}/scene`, { signal });
        if (page.live.state === null) return; // and what was found is of before
        if (found.calibration_id !== scene?.calibration_id) begin(found);
        scene = found;
        say("");
      } catch (error) {
        if (error.name === "AbortError") throw error;
        say(error.message);
      }
      redraw();
    },
    { pause: PAUSE, signal },
  );

  /** Say what keeps the rig from being drawn. */
  function say(sentence) {
    setText(missing, sentence);
    missing.hidden = sentence === "";
    drawing.hidden = sentence !== "";
    controls.hidden = sentence !== "";
  }

  function begin(found) {
    if (found.cameras.length) view.stand(found.cameras[0].pose);
    fitted = null;
  }

  function fit() {
    const points = extent(scene);
    view.measure(points);
    view.fit([...points, ...ends(scene, view.size)], canvas.clientWidth, canvas.clientHeight);
    enlarged = enlargement(scene, view.size);
    const drawn = `Ellipsoids: one standard deviation of a place, drawn ${enlarged?.toLocaleString()} times as large.`;
    setText(scale, enlarged === null ? "How sure the places are is not known." : drawn);
  }

  function redraw() {
    if (scene === null || drawing.hidden || !canvas.clientWidth) return;
    const { clientWidth: width, clientHeight: height } = canvas;
    const framed = `${width} ${height}`;
    if (framed !== fitted || !scene.cameras.every(({ pose }) => view.shows(origin(pose)))) fit();
    fitted = framed;
    const dense = window.devicePixelRatio || 1;
    Object.assign(canvas, { width: width * dense, height: height * dense });
    const context = canvas.getContext("2d");
    context.scale(dense, dense);
    const style = getComputedStyle(document.documentElement);
    const colours = Object.fromEntries(COLOURS.map((name) => [name, style.getPropertyValue(`--${name}`)]));
    draw(context, scene, view, enlarged, colours);
    canvas.dataset.readings = scene.readings.join(" ");
    if (numbers.open) fill(rows, tableOf(scene));
  }

  function change(act) {
    act();
    redraw();
  }

  canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    if (!canvas.hasPointerCapture(event.pointerId)) return;
    change(() => view.turn(event.movementX / 150, event.movementY / 150));
  });
  canvas.addEventListener("keydown", (event) => {
    const acts = {
      ArrowLeft: () => view.turn(-STEP, 0),
      ArrowRight: () => view.turn(STEP, 0),
      ArrowUp: () => view.turn(0, -STEP),
      ArrowDown: () => view.turn(0, STEP),
      "+": () => view.zoom(1.25),
      "-": () => view.zoom(1 / 1.25),
      0: fit,
    };
    if (acts[event.key] === undefined || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    change(acts[event.key]);
  });
  numbers.addEventListener("toggle", redraw);

  const seeing = new IntersectionObserver(([entry]) => {
    isSeen = entry.isIntersecting;
    if (isSeen) look();
  });
  seeing.observe(element);
  const sizing = new ResizeObserver(redraw);
  sizing.observe(canvas);
  signal.addEventListener("abort", () => {
    seeing.disconnect();
    sizing.disconnect();
  });
  document.addEventListener("visibilitychange", () => look(), { signal });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw, { signal });

  page.follow((state) => {
    if (state === null) {
      asked = null;
      say("Where the rig stands is not known without a connection to the daemon.");
      return;
    }
    const { calibration_id: id, axes } = state.rig;
    const unknown = axes.filter(({ homed, position }) => !homed || position === null).map(({ name }) => name);
    const now = JSON.stringify([id, unknown, axes.map(({ position, tolerance }) => Math.round((10 * position) / tolerance))]);
    if (now === asked) return;
    asked = now;
    if (id === null) say("It can be drawn once the rig is calibrated: where its axes and its camera are is not known yet.");
    else if (unknown.length) say(`It can be drawn once all axes know where they are: home ${unknown.join(", ")}.`);
    else look();
  }, signal);
}

/** Return the scene in numbers, in the world's frame. */
function tableOf({ base, joints, cameras, target }) {
  const place = (point) => point.map((each) => number(1000 * each, 1));
  const way = (vector) => vector.map((each) => number(each, 2)).join(", ");
  const column = (pose, i) => pose.slice(0, 3).map((row) => row[i]);
  const std = ({ uncertainty }) => (uncertainty === null ? "–" : `± ${quantity(1000 * Math.max(...uncertainty.radii), "mm", 3)}`);
  const rows = [
    ["base", ...place(origin(base)), "–", "–"],
    ...joints.flatMap((joint) => [
      [`axis of ${joint.name}`, ...place(joint.point), way(joint.axis), std(joint)],
      [`link of ${joint.name}`, ...place(origin(joint.frame)), `z ${way(column(joint.frame, 2))}`, "–"],
    ]),
    ...cameras.map((camera) => [`camera ${camera.name}`, ...place(origin(camera.pose)), `looks ${way(column(camera.pose, 2))}`, std(camera)]),
  ];
  if (target.outline.length) {
    const [first, , opposite] = target.outline;
    rows.push(["target’s middle", ...place(plus(first, times(minus(opposite, first), 0.5))), "normal 0, 0, 1", "–"]);
  }
  const numeric = (title) => ({ title, number: true });
  const columns = ["What", numeric("x (mm)"), numeric("y (mm)"), numeric("z (mm)"), "Direction", numeric("Known to")];
  return table("Places in the world’s frame, which is the target’s; known to: one standard deviation", columns, rows);
}
