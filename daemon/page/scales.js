/** What one count of an axis is, as the active calibration has found it. */

/** Degrees or millimetres for one reading unit, by the axis's name; nothing while there is no calibration. */
export class Scales {
  #page;
  #of = null;
  #scales = new Map();

  constructor(page, signal) {
    this.#page = page;
    page.follow((state) => state !== null && this.#follow(state.rig, signal), signal);
  }

  /** Return how many degrees or mm one of the axis's readings is, null where nobody knows. */
  get(name) {
    return this.#scales.get(name) ?? null;
  }

  async #follow({ calibration_id: id }, signal) {
    if (id === this.#of) return;
    this.#of = id;
    this.#scales.clear();
    if (id === null) return;
    try {
      const { calibration } = await this.#page.api.get(`calibrations/${id}`, { signal });
      for (const { name, kind, scale } of calibration.joints) {
        this.#scales.set(name, scale * (kind === "revolute" ? 180 / Math.PI : 1000));
      }
    } catch {
      // Readings are shown as they are then.
    }
  }
}
