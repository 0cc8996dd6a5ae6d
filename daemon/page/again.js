/** Asking again: as often as there is news, and never twice at once. */

/**
 * Return a function that has `work` done. Asked for while that is under way, it is done once more after it, and not
 * before `pause` milliseconds have passed: however much news comes, one answer is waited for at a time.
 * @param {() => Promise} work
 */
export function again(work, { pause = 0, signal } = {}) {
  let wanted = false;
  let working = false;
  return async function ask() {
    wanted = true;
    if (working) return;
    working = true;
    try {
      while (wanted && !signal?.aborted) {
        wanted = false;
        await work();
        if (pause) await new Promise((resolve) => setTimeout(resolve, pause));
      }
    } catch (error) {
      if (error.name !== "AbortError") throw error;
    } finally {
      working = false;
    }
  };
}

/** Return an abort controller that is aborted with `signal`, and may be before it. */
export function within(signal) {
  const inner = new AbortController();
  signal.addEventListener("abort", () => inner.abort(), { signal: inner.signal });
  return inner;
}
