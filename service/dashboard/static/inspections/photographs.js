// @ts-check
// The photographs of the inspections as thumbnails, by state; each opens larger. Their files are read with the reader's key
// when they come to the screen, and kept by the browser: a photograph never changes.

import { clutchPath, readFile } from "../shared/api.js";
import { h } from "../shared/dom.js";
import { fixed } from "../shared/format.js";

/** @import { InspectionOut } from "../shared/types.js" */

/** @typedef {{ path: string, text: string }} Shown a photograph's address, and what it shows in words */

export class Photographs {
  /** @param {string} clutchId */
  constructor(clutchId) {
    this.base = `${clutchPath(clutchId)}/inspections`;
    this.element = h("div", { class: "photographs" });
    /** @type {Map<string, Promise<string>>} addresses of files that were read, by path */
    this.files = new Map();
    /** @type {Map<Element, Shown>} */
    this.waiting = new Map();
    this.visibility = new IntersectionObserver(
      (entries) => {
        for (const { target, isIntersecting } of entries) if (isIntersecting) this.load(target);
      },
      { rootMargin: "300px" },
    );
  }

  /** @param {InspectionOut[]} inspections by cycles */
  show(inspections) {
    this.visibility.disconnect();
    this.waiting.clear();
    const shown = inspections.filter(({ photographs }) => photographs.length > 0);
    this.element.replaceChildren(...shown.map((inspection) => this.state(inspection)));
  }

  /** @param {InspectionOut} inspection */
  state({ inspection_id: id, cycles, lining, photographs }) {
    const state = `${fixed(cycles)} cycles${lining ? `, ${lining}` : ""}`;
    const thumbnails = photographs.map((photograph, index) => {
      const path = `${this.base}/${id}/photographs/${photograph.photograph_id}`;
      return this.thumbnail({ path, text: `Photograph ${index + 1} of ${photographs.length} at ${state}` });
    });
    return h("figure", {}, h("figcaption", {}, `At ${state}`), h("div", { class: "thumbnails" }, thumbnails));
  }

  /** @param {Shown} photograph */
  thumbnail(photograph) {
    const open = () => this.open(photograph);
    const label = `${photograph.text}: show it larger`;
    const button = h("button", { type: "button", class: "thumbnail", "aria-label": label, onclick: open });
    this.waiting.set(button, photograph);
    this.visibility.observe(button);
    return button;
  }

  /** @param {Element} button */
  async load(button) {
    const photograph = this.waiting.get(button);
    if (photograph === undefined) return;
    this.waiting.delete(button);
    this.visibility.unobserve(button);
    try {
      button.replaceChildren(h("img", { src: await this.file(photograph.path), alt: "" }));
    } catch {
      button.replaceChildren("could not be read");
    }
  }

  /** @param {string} path */
  file(path) {
    const held = this.files.get(path);
    if (held !== undefined) return held;
    const file = readFile(path).then((blob) => URL.createObjectURL(blob));
    this.files.set(path, file);
    file.catch(() => this.files.delete(path)); // asked for again when it is next shown
    return file;
  }

  /** @param {Shown} photograph */
  async open({ path, text }) {
    const dialog = h("dialog", { class: "photograph", "aria-labelledby": "photograph-title" });
    const close = h("button", { type: "button", class: "main", onclick: () => dialog.close() }, "Close");
    const image = h("img", { alt: text });
    dialog.append(h("h2", { id: "photograph-title" }, text), image, h("div", { class: "buttons" }, close));
    dialog.addEventListener("close", () => dialog.remove());
    document.body.append(dialog);
    dialog.showModal();
    try {
      image.src = await this.file(path);
    } catch {
      image.replaceWith(h("p", { class: "notice bad", role: "alert" }, "The photograph could not be read."));
    }
  }
}
