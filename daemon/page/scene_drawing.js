/** Drawing a scene: what each thing looks like. Lengths are shares of the scene's size. */

import { length, minus, normals, plus, times, unit } from "./scene_view.js";

const FRAME = 0.07;
const AXIS = 0.22;
const RING = 0.05;
/** How high a name is (px). */
const LINE = 14;
const AROUND = Array.from({ length: 49 }, (_, i) => (i * Math.PI) / 24);

/** Return the points by which a scene is framed: link frames may lie far off, where axes are nearly parallel. */
export function extent({ joints, cameras, target }) {
  const seen = cameras.flatMap(({ pose, corners }) => [origin(pose), ...(corners ?? [])]);
  const points = [...target.outline, ...seen, ...joints.map(({ point }) => point)];
  return points.length ? points : [[0, 0, 0]];
}

/** Return the ends of the axes as they are drawn in a scene of `size`. */
export function ends({ joints }, size) {
  return joints.flatMap(({ axis, point }) => [-AXIS, AXIS].map((share) => plus(point, times(axis, share * size))));
}

/** Return by how much to enlarge ellipsoids so that the largest is well seen: 1, 2 or 5 times a power of ten. */
export function enlargement(scene, size) {
  const largest = Math.max(0, ...sure(scene).flatMap(({ radii }) => radii));
  if (!(largest > 0)) return null;
  const wanted = (0.06 * size) / largest;
  const power = 10 ** Math.floor(Math.log10(wanted));
  return [5, 2, 1].find((digit) => digit * power <= wanted) * power;
}

export function origin(pose) {
  return pose.slice(0, 3).map((row) => row[3]);
}

/**
 * Draw a scene.
 * @param {CanvasRenderingContext2D} context
 * @param {SceneView} view
 * @param {number|null} enlarged By how much ellipsoids are.
 * @param {Object} colours By name: text, muted, accent, warning, good, danger, surface.
 */
export function draw(context, scene, view, enlarged, colours) {
  const pen = new Pen(context, view, colours);
  pen.target(scene.target);
  pen.frame(scene.base, "base", 1.5);
  for (const joint of scene.joints) {
    pen.frame(joint.frame, null, 1);
    pen.joint(joint);
  }
  for (const camera of scene.cameras) pen.camera(camera);
  if (enlarged !== null) for (const each of sure(scene)) pen.ellipsoid(each, enlarged);
  pen.names();
}

function overlap(one, other) {
  const apart = Math.abs(one.y - other.y) > LINE;
  return !apart && one.x < other.x + other.width && other.x < one.x + one.width;
}

function sure({ joints, cameras }) {
  return [...joints, ...cameras].map(({ uncertainty }) => uncertainty).filter((each) => each !== null);
}

class Pen {
  #context;
  #view;
  #colours;
  #labels = [];

  constructor(context, view, colours) {
    this.#context = context;
    this.#view = view;
    this.#colours = colours;
    context.lineJoin = "round";
    context.font = "13px system-ui, sans-serif";
  }

  target({ points, outline }) {
    const { muted, text } = this.#colours;
    if (!outline.length) return;
    this.#line([...outline, outline[0]], muted, 1, { filled: 0.12 });
    this.#context.fillStyle = muted;
    for (const point of points) {
      const [x, y] = this.#view.at(point);
      this.#context.fillRect(x - 1, y - 1, 2, 2);
    }
    this.#label("target", outline[3], text, 16);
  }

  frame(pose, name, width) {
    const at = origin(pose);
    const { danger, good, accent, muted } = this.#colours;
    [danger, good, accent].forEach((colour, i) => {
      const way = pose.slice(0, 3).map((row) => row[i]);
      this.#line([at, plus(at, times(way, FRAME * this.#view.size))], colour, width);
    });
    if (name !== null) this.#label(name, at, muted, 16);
  }

  /** A screw: a straight axis is an arrow, a turning one has a ring around it that points the way of growing readings. */
  joint({ name, kind, axis, point }) {
    const { text } = this.#colours;
    const size = this.#view.size;
    const end = plus(point, times(axis, AXIS * size));
    const turns = kind === "revolute";
    this.#line([plus(point, times(axis, -AXIS * size)), end], text, 1.5, { dashed: turns });
    if (turns) {
      const [u, v] = normals(axis);
      const middle = plus(point, times(axis, 0.12 * size));
      const on = (angle) => plus(middle, plus(times(u, RING * size * Math.cos(angle)), times(v, RING * size * Math.sin(angle))));
      const arc = AROUND.slice(0, 41).map(on);
      this.#line(arc, text, 1.5);
      this.#tip(arc.at(-1), unit(minus(arc.at(-1), arc.at(-2))), text);
    } else {
      this.#tip(end, axis, text);
    }
    this.#label(name, end, text);
  }

  camera({ name, pose, corners }) {
    const { accent } = this.#colours;
    const eye = origin(pose);
    if (corners !== null) {
      for (const corner of corners) this.#line([eye, corner], accent, 1);
      this.#line([...corners, corners[0]], accent, 2, { filled: 0.12 });
      this.#line([corners[0], corners[1]], accent, 4); // the picture's upper edge
    }
    const [x, y] = this.#view.at(eye);
    this.#context.fillStyle = accent;
    this.#context.beginPath();
    this.#context.arc(x, y, 4, 0, 2 * Math.PI);
    this.#context.fill();
    this.#label(name, eye, accent);
  }

  /** One standard deviation, enlarged: its outline, and its three sections. */
  ellipsoid({ centre, axes, radii }, enlarged) {
    const half = axes.map((axis, i) => times(axis, enlarged * radii[i]));
    const { warning } = this.#colours;
    const flat = half.map((each) => this.#view.along(each));
    const [xx, xy, yy] = [[0, 0], [0, 1], [1, 1]].map(([i, j]) => flat.reduce((sum, each) => sum + each[i] * each[j], 0));
    const [x, y] = this.#view.at(centre);
    const a = Math.sqrt(xx); // a Cholesky factor takes the circle to the outline
    const b = a > 0 ? xy / a : 0;
    const c = Math.sqrt(Math.max(0, yy - b * b));
    this.#path(AROUND.map((angle) => [x + a * Math.cos(angle), y + b * Math.cos(angle) + c * Math.sin(angle)]), warning, 1.5, { filled: 0.18 });
    for (const [i, j] of [[0, 1], [1, 2], [2, 0]]) {
      this.#line(AROUND.map((angle) => plus(centre, plus(times(half[i], Math.cos(angle)), times(half[j], Math.sin(angle))))), warning, 0.5);
    }
  }

  #tip(point, direction, colour) {
    const [x, y] = this.#view.at(point);
    const way = this.#view.along(direction);
    if (length(way) < 1e-6) return;
    const [dx, dy] = times(unit(way), 9);
    this.#path([[x - dx - dy / 2, y - dy + dx / 2], [x, y], [x - dx + dy / 2, y - dy - dx / 2]], colour, 1.5);
  }

  /** Write the names, the camera's first, over all else and none over another: beside their points, above or below. */
  names() {
    const context = this.#context;
    const written = [];
    context.strokeStyle = this.#colours.surface;
    context.lineWidth = 4;
    for (const { text, at, colour, lower } of this.#labels.toReversed()) {
      const { width } = context.measureText(text);
      const places = [[8, lower], [8, 10 - lower], [-8 - width, lower], [-8 - width, 10 - lower], [8, 22 + lower]];
      const boxes = places.map((place) => plus(at, place)).map(([x, y]) => ({ x, y, width }));
      const box = boxes.find((one) => !written.some((other) => overlap(one, other))) ?? boxes[0];
      written.push(box);
      context.strokeText(text, box.x, box.y);
      context.fillStyle = colour;
      context.fillText(text, box.x, box.y);
    }
  }

  #label(text, point, colour, lower = -6) {
    this.#labels.push({ text, at: this.#view.at(point), colour, lower });
  }

  #line(points, colour, width, style) {
    this.#path(points.map((point) => this.#view.at(point)), colour, width, style);
  }

  #path(points, colour, width, { dashed = false, filled = 0 } = {}) {
    const context = this.#context;
    context.beginPath();
    for (const [x, y] of points) context.lineTo(x, y);
    if (filled) {
      context.globalAlpha = filled;
      context.fillStyle = colour;
      context.fill();
      context.globalAlpha = 1;
    }
    context.setLineDash(dashed ? [6, 4] : []);
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.stroke();
    context.setLineDash([]);
  }
}
