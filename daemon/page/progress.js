/** What the events of a run come to: how far it is, what it does now, and what it has found. */

export class Progress {
  /** Of the run, as the API names it. */
  state = "running";
  /** What it does: "beginning", "homing", "measuring", "solving". */
  phase = "beginning";
  /** The axis that is homed, or the joint that is swept; null where all axes move. */
  joint = null;
  position = 0;
  of = 0;
  /** By position: the event of the view that was taken there. */
  taken = new Map();
  warnings = [];
  solving = null;
  quality = null;
  end = null;
  /** How many seconds passed from each position to the next one. */
  #lasted = new Map();
  #moving = null;

  constructor(events) {
    for (const event of events) this.tell(event);
  }

  /** Take in the next event. */
  tell(event) {
    this[`_${event.type}`]?.(event);
  }

  get over() {
    return this.end !== null;
  }

  /** Return what is at a position: "taken", "now", "unseen" or "to come". */
  at(position) {
    if (this.taken.has(position)) return "taken";
    if (position === this.position && this.phase === "measuring") return this.over ? "to come" : "now";
    return position <= this.position ? "unseen" : "to come";
  }

  /**
   * Return about how many seconds the measuring will go on, by the plan and by how long its positions took so far.
   * @param {Array} positions The plan's.
   * @param {number} now By the daemon's clock (ms).
   */
  timeLeft(positions, now) {
    const measured = positions.filter(({ position }) => this.#lasted.has(position));
    const sum = (some) => some.reduce((total, { seconds }) => total + seconds, 0);
    const lasted = measured.reduce((total, { position }) => total + this.#lasted.get(position), 0);
    const pace = measured.length ? lasted / sum(measured) : 1;
    const ahead = pace * sum(positions.filter(({ position }) => position > this.position));
    if (this.#moving === null) return ahead;
    const here = pace * sum(positions.filter(({ position }) => position === this.position));
    return ahead + Math.max(0, here - Math.max(0, now - this.#moving.at) / 1000);
  }

  _state({ state }) {
    this.state = state;
    if (this.over) this.phase = "beginning";
    this.end = null;
    this.#moving = null; // a pause is not the pace of the rig
  }

  _plan({ views, done }) {
    this.of = views;
    this.position = done;
    for (const position of this.taken.keys()) {
      if (position > done) this.taken.delete(position); // of a sweep that is taken again
    }
  }

  _homing({ axis }) {
    this.phase = "homing";
    this.joint = axis;
  }

  _joint({ joint }) {
    this.phase = "measuring";
    this.joint = joint;
  }

  _moving({ position, of, time }) {
    const at = Date.parse(time);
    if (this.#moving !== null) this.#lasted.set(this.#moving.position, (at - this.#moving.at) / 1000);
    this.#moving = { position, at };
    this.phase = "measuring";
    this.position = position;
    this.of = of;
  }

  _view(event) {
    this.taken.set(event.position, event);
  }

  _warning({ message }) {
    this.warnings.push(message);
  }

  _solving({ message }) {
    this.phase = "solving";
    this.solving = message;
  }

  _solved({ quality }) {
    this.quality = quality;
  }

  _finished(event) {
    this.state = event.state;
    this.end = event;
  }
}
