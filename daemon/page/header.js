/** The header: which rig, whether it answers, who asks, and who may move. */

import { fill, h, setText } from "./elements.js";

const LOST = "The daemon does not answer. Nothing here is up to date; this page connects again by itself.";
const DEAD = ["lost", "No connection", LOST];

/** Follow the state for as long as the page is open. */
export function mountHeader(page, banners) {
  const name = document.getElementById("rig-name");
  const connection = document.getElementById("connection");
  const lease = document.getElementById("lease");
  const dead = h("div", { class: "banner dead", role: "alert" });
  const problems = h("div", { class: "banner problems", role: "status" });
  let shown = null;
  let known = false;
  banners.append(dead, problems);

  page.follow((state) => {
    known ||= state !== null;
    if (!known) return; // the first one is on its way, or a key is asked for
    setText(problems, state?.problems.join(" ") ?? "");
    if (state !== null) {
      setText(name, state.rig.name);
      name.title = state.rig.name; // which may be cut off
      document.title = `${state.rig.name} – activecam`;
      tellConnection("live", whatGoesOn(state), "");
    } else {
      tellConnection(...DEAD);
    }
    const now = JSON.stringify([state?.you, state?.rig.lease?.owner, state?.rig.lease?.expires_at === null]);
    if (now !== shown) tellLease(page, lease, state);
    shown = now;
  });
  page.live.addEventListener("refused", () => tellConnection(...DEAD));

  function tellConnection(kind, words, banner) {
    document.documentElement.dataset.connection = kind;
    setText(connection, words);
    setText(dead, banner);
  }
}

function whatGoesOn(state) {
  if (state.rig.run !== null) return `A run is ${state.run.state}`;
  if (state.rig.moving) return "Moving";
  return "Connected";
}

function tellLease(page, element, state) {
  if (state === null) {
    fill(element);
    return;
  }
  const { lease } = state.rig;
  const button = (text, work) => h("button", { type: "button", onclick: () => page.attempt(work) }, text);
  const may = state.you.may.includes("move");
  const who = state.you.key === null ? null : h("p", { class: "who" }, `${state.you.key}, ${state.you.role} `, signOut(page));
  if (lease === null) {
    fill(element, who, h("p", {}, "Nobody has control"), may && button("Take control", () => page.lease.take()));
  } else if (state.you.holds_lease) {
    fill(element, who, h("p", {}, h("strong", {}, "You have control")), button("Give back", () => page.lease.release()));
  } else if (lease.expires_at === null) {
    fill(element, who, h("p", {}, "The run has control"));
  } else {
    const over = () => page.lease.take({ over: true });
    fill(element, who, h("p", {}, `“${lease.owner}” has control`), may && button("Take over", over));
  }
}

function signOut(page) {
  const leave = async () => {
    await page.attempt(() => page.api.delete("session"));
    location.reload();
  };
  return h("button", { type: "button", class: "plain", onclick: leave }, "Sign out");
}
