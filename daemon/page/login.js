/** Showing a key, where the daemon asks for one: a cookie that no script can read stands for it afterwards. */

import { fill, h, setText } from "./elements.js";

/** Return when the daemon knows who asks; `element` has the form for that meanwhile. */
export async function signedIn(page, element) {
  try {
    await page.api.get("session");
  } catch (error) {
    if (error.status !== 401) return; // the daemon is away: the socket finds it again
    await new Promise((resolve) => askForKey(page, element, resolve));
  }
}

function askForKey(page, element, done) {
  const input = h("input", { id: "key", type: "password", autocomplete: "current-password", required: true });
  const problem = h("p", { class: "problem", role: "alert" });
  const form = h(
    "form",
    { class: "panel login" },
    h("h2", {}, "Who are you?"),
    h("p", {}, "This rig asks for a key. Whoever runs it makes one with ", h("code", {}, "activecam key add"), "."),
    h("label", { for: "key" }, "Key"),
    input,
    problem,
    h("button", { class: "primary" }, "Sign in"),
  );
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    problem.textContent = "";
    try {
      await page.api.post("session", undefined, { headers: { Authorization: `Bearer ${input.value.trim()}` } });
      fill(element);
      done();
    } catch (error) {
      problem.textContent = error.message;
      input.focus();
    }
  });
  setText(document.getElementById("connection"), "Not signed in");
  fill(element, form);
  input.focus();
}
