/** The page, put together: first the stop, then all else. */

import { mountHeader } from "./header.js";
import { signedIn } from "./login.js";
import { Page } from "./page.js";
import { mountSections } from "./router.js";
import { mountStop } from "./stop.js";

const page = new Page();
const banners = document.getElementById("banners");
const content = document.getElementById("content");

mountStop(page, banners);
mountHeader(page, banners);
await signedIn(page, content);
page.live.connect();
mountSections(page, document.getElementById("sections"), content);

// A daemon that was restarted knows no session any more.
page.live.addEventListener("refused", async () => {
  try {
    await page.api.get("session");
  } catch (error) {
    if (error.status === 401) location.reload();
  }
});
// A tab that is looked at again does not wait for its next attempt.
document.addEventListener("visibilitychange", () => {
  if (!document.hidden) page.live.connect();
});
