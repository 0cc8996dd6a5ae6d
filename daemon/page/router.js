/** Which section is shown: `#/judge/abc` is the section `judge`, which is told of `abc`. */

import { fill, h } from "./elements.js";
import { sections } from "./sections.js";

/** Show the section that the address names, now and whenever it changes. */
export function mountSections(page, nav, content) {
  const links = new Map(sections.map(({ id, title }) => [id, h("a", { href: `#/${id}` }, title)]));
  let shown = new AbortController();
  fill(nav, h("ul", {}, ...[...links.values()].map((link) => h("li", {}, link))));

  async function show() {
    if (location.hash && !location.hash.startsWith("#/")) return; // a place within the page
    const [id, ...path] = location.hash.slice(2).split("/").map(decodeURIComponent);
    const section = sections.find((each) => each.id === id) ?? sections[0];
    shown.abort();
    shown = new AbortController();
    const { signal } = shown;
    for (const [name, link] of links) {
      if (name === section.id) link.setAttribute("aria-current", "page");
      else link.removeAttribute("aria-current");
    }
    const element = h("div", { class: `section ${section.id}` });
    try {
      const { mount } = await section.load();
      if (signal.aborted) return;
      fill(content, element);
      await mount(element, page, { signal, path });
    } catch (error) {
      if (error.name === "AbortError" || signal.aborted) return;
      fill(content, h("p", { class: "problem", role: "alert" }, `This section cannot be shown: ${error.message}`));
      throw error;
    }
  }

  window.addEventListener("hashchange", () => {
    show();
    if (location.hash.startsWith("#/")) content.focus({ preventScroll: true });
  });
  show();
}
