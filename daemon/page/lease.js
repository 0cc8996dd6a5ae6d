/** The right to move, as this page holds it: taken when moving is first asked for, and kept up while it is used. */

/** Seconds for which the lease outlives its last renewal, and those while an axis moves for as long as a key is held. */
const LIFE = 30;
const LIFE_WHILE_HELD = 1;

export class Lease {
  #page;
  #renewing = null;
  #known = false;

  constructor(page) {
    this.#page = page;
    page.live.addEventListener("state", () => this.#follow());
  }

  /** Whether this page may move. */
  get held() {
    return this.#page.live.state?.you.holds_lease ?? false;
  }

  /** Who may move now, null where nobody does. */
  get holder() {
    return this.#page.live.state?.rig.lease ?? null;
  }

  /** Take the lease, or renew it; `over`: from whoever else holds it. Throws a Problem. */
  async take({ over = false, life = LIFE } = {}) {
    const wish = { owner: this.#page.owner, note: "the page", ttl_s: life };
    const lease = await this.#page.live.do("lease", over ? { ...wish, take_over: true } : wish);
    this.#page.api.lease = lease.token;
    this.#renewing ??= setInterval(() => this.take().catch(() => {}), (LIFE / 3) * 1000);
  }

  /** Take it where this page does not hold it; throws a Problem where somebody else does. */
  async need() {
    if (!this.held) await this.take();
  }

  /** Give it back, and so stop what moves under it. */
  async release() {
    this.#forget();
    await this.#page.live.do("release");
  }

  /**
   * Keep the lease for as long as `signal` is not aborted, so closely that it ends within a second when this page, or
   * the network, is gone.
   */
  holdOn(signal) {
    const renew = () => this.take({ life: LIFE_WHILE_HELD }).catch(() => {});
    const renewing = setInterval(renew, (LIFE_WHILE_HELD / 4) * 1000);
    signal.addEventListener("abort", () => {
      clearInterval(renewing);
      if (this.held) this.take().catch(() => {});
    });
  }

  /** Once it has ended, it is not taken again unasked. */
  #follow() {
    if (this.#known && !this.held) this.#forget();
    this.#known = this.held;
  }

  #forget() {
    clearInterval(this.#renewing);
    this.#renewing = null;
    this.#page.api.lease = null;
  }
}
