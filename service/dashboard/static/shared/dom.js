// Elements without a framework. Text is always text: nothing that comes from outside is ever parsed as HTML.

/**
 * @typedef {Node | string | null | undefined | false} Child left out where it is null, undefined or false
 * @typedef {Child | readonly (Child | readonly Child[])[]} Content
 * @typedef {string | number | boolean | null | undefined | ((event: any) => unknown) | Record<string, string>} Value
 * @typedef {Record<string, Value>} Attributes `on…` are listeners, `style` its properties, `href` may be the service's own address; null and false are left out
 */

import { at } from "./api.js";
import { inWords } from "./words.js";

const SVG = "http://www.w3.org/2000/svg";

/**
 * An element by its name and classes ("p", "p.notice.bad"); then attributes, where it has any, and its children.
 * @template {keyof HTMLElementTagNameMap} Name
 * @param {Name | `${Name}.${string}`} name
 * @param {(Attributes | Content)[]} rest
 * @returns {HTMLElementTagNameMap[Name]}
 */
export function h(name, ...rest) {
  const [tag, ...classes] = name.split(".");
  return filled(document.createElement(/** @type {Name} */ (tag)), classes, rest);
}

/**
 * The same for SVG.
 * @template {keyof SVGElementTagNameMap} Name
 * @param {Name | `${Name}.${string}`} name
 * @param {(Attributes | Content)[]} rest
 * @returns {SVGElementTagNameMap[Name]}
 */
export function svg(name, ...rest) {
  const [tag, ...classes] = name.split(".");
  return filled(document.createElementNS(SVG, /** @type {Name} */ (tag)), classes, rest);
}

/** @type {(value: Attributes | Content) => value is Attributes} */
const isAttributes = (value) => value?.constructor === Object;

/**
 * @template {HTMLElement | SVGElement} Filled
 * @param {Filled} element
 * @param {string[]} classes
 * @param {(Attributes | Content)[]} rest
 */
function filled(element, classes, [first, ...children]) {
  if (classes.length > 0) element.setAttribute("class", classes.join(" "));
  if (!isAttributes(first)) children.unshift(first);
  for (const [key, value] of isAttributes(first) ? Object.entries(first) : []) {
    if (value === null || value === undefined || value === false) continue;
    if (typeof value === "function") element.addEventListener(key.slice(2), value);
    else if (typeof value === "object") {
      for (const [property, set] of Object.entries(value)) element.style.setProperty(property, set);
    } else if (key === "href") element.setAttribute(key, at(String(value)));
    else element.setAttribute(key, value === true ? "" : String(value));
  }
  const flat = /** @type {Child[]} */ (children.flat(2));
  const shown = flat.filter((child) => child !== null && child !== undefined && child !== false);
  element.append(...shown.map((child) => (typeof child === "string" ? inWords(child) : child)));
  return element;
}

/** @type {(id: string, title: string, ...content: Content[]) => HTMLElement} a part of the page under its heading */
export const section = (id, title, ...content) =>
  h("section", { id, "aria-labelledby": `${id}-title` }, h("h2", { id: `${id}-title` }, title), ...content);

/** @type {(id: string) => HTMLElement} an element that the page always has */
export function byId(id) {
  const element = document.getElementById(id);
  if (element === null) throw new Error(`the page has no element #${id}`);
  return element;
}

/** @type {(element: Element, margin: number, told: (near: boolean) => unknown) => void} `told` hears whether it is near the screen, px */
export function watch(element, margin, told) {
  const observer = new IntersectionObserver((entries) => told(entries[entries.length - 1].isIntersecting), {
    rootMargin: `${margin}px`,
  });
  observer.observe(element);
}

/** @type {(names: string[], name: string) => void} of the page's tabs the one of that name in sight, its link marked */
export function showTab(names, name) {
  for (const key of names) byId(`tab-${key}`).hidden = key !== name;
  for (const link of byId("tabs").querySelectorAll("a")) {
    if (link.hash === `#/${name}`) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
}

/** @type {(label: Content, onclick: ((event: any) => unknown) | null, attributes?: Attributes) => HTMLButtonElement} */
export const button = (label, onclick, attributes = {}) =>
  h("button", { type: "button", ...attributes, onclick }, label);

/** @type {(attributes: Attributes, options: [string | number, string][], chosen: unknown) => HTMLSelectElement} */
export function select(attributes, options, chosen) {
  const children = options.map(([value, text]) =>
    h("option", { value, selected: String(value) === String(chosen) }, text),
  );
  return h("select", attributes, children);
}

/**
 * What `select` offers: each value with its text.
 * @template {string | number} Value
 * @param {readonly Value[]} values
 * @param {(value: Value) => string} text
 */
export const offered = (values, text) => values.map((value) => /** @type {[Value, string]} */ ([value, text(value)]));

/** @type {(...content: Content[]) => HTMLElement} a paragraph beside the matter */
export const quiet = (...content) => h("p.quiet", ...content);

/** @type {(attributes: Attributes) => HTMLInputElement} a field for a number */
export const numberInput = (attributes) =>
  h("input", { type: "number", step: "any", inputmode: "decimal", ...attributes });

/** Numbers the fields that have no name of their own. */
let fields = 0;

/**
 * A field below its label.
 * @param {HTMLInputElement | HTMLSelectElement | HTMLTextAreaElement} input
 * @param {Content} label
 * @param {Content} [more] what stands below it
 */
export function field(input, label, more = null) {
  input.id ||= `field-${(fields += 1)}`;
  return h("div", h("label", { for: input.id }, label), input, more);
}

/** @type {(submit: () => unknown, ...content: Content[]) => HTMLFormElement} a form whose values the browser does not keep */
export function form(submit, ...content) {
  const onsubmit = (/** @type {SubmitEvent} */ event) => {
    event.preventDefault();
    submit();
  };
  return h("form", { autocomplete: "off", onsubmit }, ...content);
}

/** @type {(place: Element, what: string, start?: number) => void} say in a place what is computed, and for how long, until something else stands there */
export function computing(place, what, start = Date.now()) {
  const line = h("span", `Computing ${what} …`);
  place.replaceChildren(line);
  const timer = setInterval(() => {
    if (line.parentElement !== place) return clearInterval(timer);
    line.textContent = `Computing ${what} for ${Math.round((Date.now() - start) / 1000)} s …`;
  }, 1000);
}

/** @type {(name: string) => void} a mark in the browser's timeline, when what was changed is on the screen */
export const markShown = (name) => void requestAnimationFrame(() => setTimeout(() => performance.mark(name)));

/** @type {(letter: string, index: string) => HTMLElement} a letter with its index */
export const symbol = (letter, index) => h("span", letter, h("sub", index));

/**
 * A table with a caption and a header; `columns` are names, rows are cells of text or nodes.
 * @param {string} caption
 * @param {Content[]} columns
 * @param {Content[][]} rows
 * @param {{ shown?: boolean }} [options] whether the caption is shown
 */
export function table(caption, columns, rows, { shown = false } = {}) {
  const header = columns.map((name) => h("th", { scope: "col" }, name));
  const lines = rows.map((row) => {
    const cells = row.map((cell) => h("td", cell ?? "–"));
    return h("tr", cells);
  });
  const title = h("caption", { class: shown ? null : "hidden" }, caption);
  return h("table", title, h("thead", h("tr", header)), h("tbody", lines));
}

/** @type {(label: string, ...content: Content[]) => HTMLElement} a place that scrolls, by keyboard too */
export const scrolling = (label, ...content) =>
  h("div.scroll", { tabindex: "0", role: "group", "aria-label": label }, ...content);

/**
 * Rare actions behind a button: opened and closed by it, left by Escape.
 * @type {(label: string, entries: { label: string, onclick: () => unknown, checked?: boolean }[]) => HTMLElement}
 */
export function menu(label, entries) {
  const details = h("details.menu", h("summary", label));
  const close = () => {
    details.open = false;
  };
  const items = entries.map(({ label: text, onclick, checked }) => {
    const choose = () => {
      close();
      onclick();
    };
    const pressed = checked === undefined ? null : String(checked);
    return button(text, choose, { "aria-pressed": pressed });
  });
  details.append(h("div.entries", items));
  details.addEventListener("keydown", (event) => {
    if (event.key !== "Escape" || !details.open) return;
    close();
    details.querySelector("summary")?.focus();
  });
  details.addEventListener("focusout", (event) => {
    if (event.relatedTarget instanceof Node && !details.contains(event.relatedTarget)) close();
  });
  return details;
}

/**
 * Draw a place again, a menu that is open in it too: it stays open, the focus on the entry of the same name.
 * @type {(place: HTMLElement, ...content: Node[]) => void}
 */
export function redraw(place, ...content) {
  const open = place.querySelector("details.menu[open]");
  const focused = open?.contains(document.activeElement) ? document.activeElement?.textContent : null;
  place.replaceChildren(...content);
  const menu = open && place.querySelector("details.menu");
  if (!menu) return;
  menu.setAttribute("open", "");
  const entries = /** @type {HTMLElement[]} */ ([...menu.querySelectorAll("summary, button")]);
  entries.find((entry) => entry.textContent === focused)?.focus();
}

/**
 * Show a dialog; `result` of it once it is closed.
 * @template Result
 * @param {HTMLDialogElement} dialog
 * @param {() => Result} result
 * @returns {Promise<Result>}
 */
export function answered(dialog, result) {
  document.body.append(dialog);
  dialog.showModal();
  return new Promise((resolve) => {
    dialog.addEventListener("close", () => {
      dialog.remove();
      resolve(result());
    });
  });
}

/** @type {(name: string, content: Blob) => void} give content to the user as a file */
export function saveBlob(name, content) {
  const address = URL.createObjectURL(content);
  h("a", { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 10_000);
}

/** @type {(text: string) => HTMLElement} a command beside a button that copies it and says so */
export function copyable(text) {
  const status = h("span.copied", { role: "status" });
  const code = h("code", text);
  const copy = async () => {
    try {
      await navigator.clipboard.writeText(text);
      status.textContent = "copied";
    } catch {
      getSelection()?.selectAllChildren(code);
      status.textContent = "selected: press Ctrl+C";
    }
    setTimeout(() => {
      status.textContent = "";
    }, 3000);
  };
  const label = `Copy: ${text.split("\n")[0].slice(0, 60)}`;
  return h("div.row.command", h("pre", { tabindex: "0" }, code), button("Copy", copy, { "aria-label": label }), status);
}
