/** The stop: on screen and on a key wherever one is, asks nothing, waits for nothing; and its acknowledgement. */

import { fill, h, setText } from "./elements.js";
import { clock } from "./units.js";

/** Milliseconds without an answer over the socket after which the stop is sent by HTTP as well. */
const PATIENCE = 400;

/** Let the button #stop, and Escape, stop everything; what is latched is told in a banner. */
export function mountStop(page, banners) {
  const button = document.getElementById("stop");
  const outcome = h("p", { class: "visually-hidden", role: "status" });
  const banner = h("div", { class: "banner stopped", role: "region", "aria-label": "Stop", hidden: true });
  banners.append(outcome, banner);

  async function stop() {
    setText(outcome, "Stopping.");
    button.classList.add("pressed");
    try {
      await sent(page);
      setText(outcome, "Stopped: all axes stand.");
    } catch (error) {
      const hint = error.status === 0 || error.status >= 500 ? " Use the switch that cuts the motors’ power." : "";
      page.tell(`The stop: ${error.message}${hint}`, "problem");
    } finally {
      button.classList.remove("pressed");
    }
  }

  button.addEventListener("click", stop);
  // Before all else that listens, wherever the focus is.
  window.addEventListener(
    "keydown",
    (event) => {
      if (event.key !== "Escape") return;
      event.preventDefault();
      if (!event.repeat) stop();
    },
    { capture: true },
  );

  page.follow((state) => {
    const looksOnly = state !== null && !state.you.may.includes("move");
    button.disabled = looksOnly;
    button.title = looksOnly ? page.obstacle("operate") : "Stop all axes at once (Escape)";
    tellLatch(page, banner, state?.rig.stop ?? null);
  });
}

/** Stop over the socket; by HTTP where that is down or silent. Throws a Problem. */
function sent(page) {
  const overHttp = () => page.api.post("stop");
  if (!page.live.connected) return overHttp();
  const overSocket = page.live.do("stop");
  return new Promise((resolve, reject) => {
    const silent = setTimeout(() => overHttp().then(resolve, () => {}), PATIENCE);
    overSocket.then(resolve, (error) => {
      if (error.status === 0) overHttp().then(resolve, reject);
      else reject(error);
    });
    overSocket.finally(() => clearTimeout(silent)).catch(() => {});
  });
}

function tellLatch(page, banner, latch) {
  const latched = latch?.latched ?? false;
  if (latched === !banner.hidden) return;
  banner.hidden = !latched;
  if (!latched) {
    fill(banner);
    return;
  }
  const acknowledge = h("button", { type: "button" }, "Acknowledge: allow motion again");
  acknowledge.addEventListener("click", () => page.attempt(() => page.live.do("acknowledge")));
  const fieldset = h("fieldset", { class: "bare" }, acknowledge);
  fill(
    banner,
    h("p", {}, h("strong", {}, "Stopped."), ` Since ${clock(latch.since)}: ${latch.reason}. Nothing moves until this is acknowledged.`),
    fieldset,
  );
  fieldset.disabled = page.obstacle("operate") !== null;
}
