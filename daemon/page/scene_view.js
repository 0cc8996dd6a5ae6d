/** How a scene is looked at: from a direction, parallel, so that nothing is in the way and lengths stay comparable. */

/** Share of the frame that is filled: names, and axes' ends, want some room. */
const FILLED = 0.7;

/** A turned and scaled drawing of points in the world. It moves only when it is told to: what moves in it is the rig. */
export class SceneView {
  /** How large the scene is, in the world: things are drawn as shares of it. */
  size = 1;
  #up = [0, -1, 0];
  #ahead = [0, 0, 1];
  #turn = 0.6;
  #tilt = 0.45;
  #centre = [0, 0, 0];
  #frame = [1, 1];
  #middle = [0, 0]; // where the centre is drawn
  #scale = 1;
  #right;
  #over;

  constructor() {
    this.turn(0, 0);
  }

  /** Call up what a camera of `pose` (4, 4) calls up. */
  stand(pose) {
    const column = (i) => pose.slice(0, 3).map((row) => row[i]);
    this.#up = times(column(1), -1);
    this.#ahead = column(2);
    this.turn(0, 0);
  }

  /** Turn about the vertical, and tilt, by radians. */
  turn(sideways, over) {
    this.#turn += sideways;
    this.#tilt = Math.min(Math.PI / 2, Math.max(-Math.PI / 2, this.#tilt + over));
    const side = unit(cross(this.#ahead, this.#up));
    const ahead = cross(this.#up, side);
    const [c, s] = [Math.cos(this.#turn), Math.sin(this.#turn)];
    const towards = plus(times(ahead, c), times(side, s));
    this.#right = plus(times(side, c), times(ahead, -s));
    this.#over = plus(times(this.#up, Math.cos(this.#tilt)), times(towards, Math.sin(this.#tilt)));
  }

  zoom(factor) {
    this.#scale *= factor;
    this.#middle = this.#middle.map((each, i) => this.#frame[i] / 2 + factor * (each - this.#frame[i] / 2));
  }

  /** Take the size of a scene from its `points`. */
  measure(points) {
    const [low, high] = box(points);
    this.size = Math.max(length(minus(high, low)), 1e-6);
  }

  /** Bring all `points` into a frame of `width` by `height`. */
  fit(points, width, height) {
    const [low, high] = box(points);
    this.#centre = times(plus(low, high), 0.5);
    this.#frame = [width, height];
    [this.#scale, this.#middle] = [1, [0, 0]];
    const [least, most] = box(points.map((point) => this.at(point)));
    const reach = minus(most, least).map((each) => Math.max(each, 0.1 * this.size));
    this.#scale = FILLED * Math.min(width / reach[0], height / reach[1]);
    this.#middle = [width / 2, height / 2].map((each, i) => each - (this.#scale * (least[i] + most[i])) / 2);
  }

  /** Return whether a point is drawn within the frame. */
  shows(point) {
    return this.at(point).every((each, i) => each >= 0 && each <= this.#frame[i]);
  }

  /** Return where a point of the world is drawn. */
  at(point) {
    return plus(this.#middle, this.along(minus(point, this.#centre)));
  }

  /** Return which way, and how long, a vector of the world is drawn. */
  along(vector) {
    return [this.#scale * dot(this.#right, vector), -this.#scale * dot(this.#over, vector)];
  }
}

/** Return the lowest and the highest coordinates of points. */
function box(points) {
  return [Math.min, Math.max].map((end) => points[0].map((_, i) => end(...points.map((point) => point[i]))));
}

export const plus = (a, b) => a.map((each, i) => each + b[i]);
export const minus = (a, b) => a.map((each, i) => each - b[i]);
export const times = (a, factor) => a.map((each) => each * factor);
export const dot = (a, b) => a.reduce((sum, each, i) => sum + each * b[i], 0);
export const length = (a) => Math.sqrt(dot(a, a));
export const unit = (a) => times(a, 1 / length(a));
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
/** Return two unit vectors that are normal to `axis` and to each other. */
export function normals(axis) {
  const least = axis.map(Math.abs).indexOf(Math.min(...axis.map(Math.abs)));
  const first = unit(cross(axis, [0, 1, 2].map((i) => (i === least ? 1 : 0))));
  return [first, cross(unit(axis), first)];
}
