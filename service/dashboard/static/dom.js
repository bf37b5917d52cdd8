// Elements without a framework. Text is always text: nothing that comes from outside is ever parsed as HTML.

const SVG = "http://www.w3.org/2000/svg";

/** An element with attributes (`on…` are listeners, null and false are left out) and children (nodes or text). */
export function h(name, attributes = {}, ...children) {
  return filled(document.createElement(name), attributes, children);
}

/** The same for SVG. */
export function svg(name, attributes = {}, ...children) {
  return filled(document.createElementNS(SVG, name), attributes, children);
}

function filled(element, attributes, children) {
  for (const [key, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else if (key === "style") for (const [property, set] of Object.entries(value)) element.style.setProperty(property, set);
    else element.setAttribute(key, value === true ? "" : value);
  }
  element.append(...children.flat(2).filter((child) => child !== null && child !== undefined && child !== false));
  return element;
}

export const byId = (id) => document.getElementById(id);

/** A letter with its index. */
export const symbol = (letter, index) => h("span", {}, letter, h("sub", {}, index));

/** A table with a caption and a header; `columns` are names, rows are cells of text or nodes. */
export function table(caption, columns, rows, attributes = {}) {
  return h("table", attributes,
    h("caption", { class: attributes.shown ? null : "hidden" }, caption),
    h("thead", {}, h("tr", {}, columns.map((name) => h("th", { scope: "col" }, name)))),
    h("tbody", {}, rows.map((row) => h("tr", {}, row.map((cell) => h("td", {}, cell ?? "–"))))));
}

/** Give a text to the user as a file. */
export function save(name, address) {
  const link = h("a", { href: address, download: name, hidden: true });
  document.body.append(link);
  link.click();
  link.remove();
}

export function saveText(name, text, type) {
  const address = URL.createObjectURL(new Blob([text], { type }));
  save(name, address);
  setTimeout(() => URL.revokeObjectURL(address), 10_000);
}

/** A button that copies a command and says so. */
export function copyable(text) {
  const said = h("span", { class: "copied", role: "status" });
  const code = h("code", {}, text);
  const copy = async () => {
    try {
      await navigator.clipboard.writeText(text);
      said.textContent = "copied";
    } catch {
      getSelection().selectAllChildren(code);
      said.textContent = "selected: press Ctrl+C";
    }
    setTimeout(() => { said.textContent = ""; }, 3000);
  };
  const label = `Copy: ${text.split("\n")[0].slice(0, 60)}`;
  return h("div", { class: "command" }, h("pre", { tabindex: "0" }, code), h("button", { type: "button", onclick: copy, "aria-label": label }, "Copy"), said);
}
