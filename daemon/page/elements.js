/** Making elements: no markup is ever put together as text. */

/**
 * Return a new element.
 * @param {string} name Its tag.
 * @param {Object} [properties] Attributes; `on…` is a listener, true an empty attribute, null and false none.
 * @param {...(Node|string|number|null|Array)} children Nodes and texts; null is left out.
 */
export function h(name, properties = {}, ...children) {
  const element = document.createElement(name);
  setAttributes(element, properties);
  element.append(...nodes(children));
  return element;
}

/** As `h`, of SVG. */
export function svg(name, properties = {}, ...children) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", name);
  setAttributes(element, properties);
  element.append(...nodes(children));
  return element;
}

/** Put `children` in place of what is in `element`. */
export function fill(element, ...children) {
  element.replaceChildren(...nodes(children));
  return element;
}

/** Set the text of an element only where it is another one: live regions speak of every change. */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/**
 * Return a table.
 * @param {string} caption What it shows.
 * @param {Array<string|{title: string, number: boolean}>} columns
 * @param {Array<Array>} rows Cells as children of `h`; the first of a row is its heading.
 */
export function table(caption, columns, rows) {
  const kinds = columns.map((column) => (column.number ? { class: "number" } : {}));
  const head = columns.map((column, i) => h("th", { scope: "col", ...kinds[i] }, column.title ?? column));
  const body = rows.map((row) =>
    h("tr", {}, ...row.map((cell, i) => (i ? h("td", kinds[i], cell) : h("th", { scope: "row", ...kinds[i] }, cell)))),
  );
  return h(
    "div",
    { class: "table", role: "region", "aria-label": caption, tabindex: "0" },
    h("table", {}, h("caption", {}, caption), h("thead", {}, h("tr", {}, ...head)), h("tbody", {}, ...body)),
  );
}

function setAttributes(element, properties) {
  for (const [key, value] of Object.entries(properties)) {
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else if (value !== null && value !== undefined && value !== false) {
      element.setAttribute(key, value === true ? "" : value);
    }
  }
}

function nodes(children) {
  return children.flat(Infinity).filter((child) => child !== null && child !== undefined && child !== false);
}
