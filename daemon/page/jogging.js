/**
 * Jogging by buttons and keys. A short press is one step. A press that is held goes on until it is let go: also when the
 * button loses the focus, the tab is left, or the connection is lost, since the lease then ends within a second.
 */

/** Milliseconds after which a press is a held one. */
const HELD = 300;

export class Jogging {
  #page;
  #press = null;

  constructor(page, signal) {
    this.#page = page;
    const release = () => this.release();
    window.addEventListener("blur", release, { signal });
    document.addEventListener("visibilitychange", release, { signal });
    signal.addEventListener("abort", release);
    page.follow((state) => {
      if (state === null || state.rig.stop.latched) this.#drop();
    }, signal);
  }

  /**
   * Return what jogs one axis.
   * @param {() => Object} axis The axis, as the API describes it now.
   * @param {() => number} step How far a short press goes, in its reading unit.
   */
  of(axis, step) {
    return {
      press: (way) => this.#begin({ axis, step, way }),
      attach: (button, way, signal) => this.#attach(button, { axis, step, way }, signal),
    };
  }

  /** End whatever is pressed. */
  release() {
    const press = this.#drop();
    if (press === null) return;
    if (press.begun === null) this.#tap(press);
    else this.#end(press);
  }

  #attach(button, jog, signal) {
    button.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      button.setPointerCapture(event.pointerId);
      this.#begin(jog);
    });
    for (const end of ["pointerup", "pointercancel", "lostpointercapture", "blur"]) {
      button.addEventListener(end, () => this.release(), { signal });
    }
    const isKey = (event) => event.key === "Enter" || event.key === " ";
    button.addEventListener("keydown", (event) => {
      if (!isKey(event)) return;
      event.preventDefault();
      if (!event.repeat) this.#begin(jog);
    });
    button.addEventListener("keyup", (event) => {
      if (!isKey(event)) return;
      event.preventDefault(); // it would be a click as well
      this.release();
    });
    // Assistive technology clicks without pressing.
    button.addEventListener("click", (event) => event.detail === 0 && event.pointerType === "" && this.#tap(jog));
  }

  #begin(jog) {
    this.release();
    if (jog.axis().moving) return;
    const press = { ...jog, begun: null, held: new AbortController() };
    press.timer = setTimeout(() => this.#hold(press), HELD);
    this.#press = press;
  }

  /** Forget what is pressed, without a motion; returns it. */
  #drop() {
    const press = this.#press;
    this.#press = null;
    if (press !== null) {
      clearTimeout(press.timer);
      press.held.abort();
    }
    return press;
  }

  #tap({ axis, step, way }) {
    return this.#page.attempt(async () => {
      await this.#page.lease.need();
      await this.#page.live.do("jog", { axis: axis().name, distance: way * step() });
    });
  }

  /** Go towards the limit; without a zero, whose limits are not known, by the length of the travel. */
  #hold(press) {
    const { name, homed, limits } = press.axis();
    const [low, high] = limits;
    const [command, parameters] = homed
      ? ["move", { targets: { [name]: press.way > 0 ? high : low } }]
      : ["jog", { axis: name, distance: press.way * (high - low) }];
    press.begun = this.#page.attempt(async () => {
      await this.#page.lease.take({ life: 1 });
      this.#page.lease.holdOn(press.held.signal);
      if (!press.held.signal.aborted) await this.#page.live.do(command, parameters);
    });
  }

  /** Stop, now, and once more when the motion has begun, should it have begun meanwhile. */
  async #end(press) {
    const stop = () => this.#page.live.do("stop_axis", { axis: press.axis().name }).catch(() => {});
    stop();
    await press.begun;
    stop();
  }
}
