// @ts-check
// The photographs of the inspections as thumbnails, by state; each opens larger. Their files are read with the reader's key
// when they come to the screen, one after the other, and kept by the browser: a photograph never changes. Of each the page
// keeps a drawing as small as its thumbnail, and the whole of one while it is open.

import { clutchPath, readFile } from "../shared/api.js";
import { answered, button, h } from "../shared/dom.js";
import { fixed } from "../shared/format.js";

/** @import { InspectionOut } from "../shared/types.js" */

/** @typedef {{ path: string, text: string }} Shown a photograph's address, and what it shows in words */

/**
 * Pixels across a drawing: the 132 of a thumbnail (inspections.css) on a screen that has two for each, and a third more, as of
 * a photograph of 16:9 the sides are cut off.
 */
const WIDTH = 352;

/**
 * A photograph's file drawn small; no more than that stays in memory.
 * @param {Blob} file
 */
async function drawn(file) {
  const small = await createImageBitmap(file, { resizeWidth: WIDTH, resizeQuality: "medium" });
  const canvas = h("canvas", { width: small.width, height: small.height, "aria-hidden": "true" });
  canvas.getContext("bitmaprenderer")?.transferFromImageBitmap(small);
  return canvas;
}

export class Photographs {
  /** @param {string} clutchId */
  constructor(clutchId) {
    this.base = `${clutchPath(clutchId)}/inspections`;
    this.element = h("div", { class: "photographs" });
    /** @type {Map<string, HTMLCanvasElement>} the drawings that are shown, by path */
    this.drawings = new Map();
    /** what is being read and drawn: a photograph at a time, as one of 24 megapixels takes 100 MB while it is drawn */
    this.queue = Promise.resolve();
    /** @type {Map<Element, Shown>} */
    this.waiting = new Map();
    this.visibility = new IntersectionObserver(
      (entries) => {
        for (const { target, isIntersecting } of entries) if (isIntersecting) this.want(target);
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
    for (const [path, drawing] of this.drawings) if (!drawing.isConnected) this.drawings.delete(path);
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
    const drawing = this.drawings.get(photograph.path);
    if (drawing !== undefined) {
      button.append(drawing);
    } else {
      this.waiting.set(button, photograph);
      this.visibility.observe(button);
    }
    return button;
  }

  /** @param {Element} button */
  want(button) {
    this.visibility.unobserve(button);
    this.queue = this.queue.then(() => this.draw(button));
  }

  /** @param {Element} button */
  async draw(button) {
    const photograph = this.waiting.get(button); // none where it is shown no more
    if (photograph === undefined) return;
    const { path } = photograph;
    try {
      const drawing = this.drawings.get(path) ?? (await drawn(await readFile(path)));
      button.replaceChildren(drawing);
      this.drawings.set(path, drawing);
    } catch {
      button.replaceChildren("could not be read");
    }
  }

  /** @param {Shown} photograph */
  async open({ path, text }) {
    const dialog = h("dialog", { class: "photograph", "aria-labelledby": "photograph-title" });
    const close = button("Close", () => dialog.close(), { class: "main" });
    const image = h("img", { alt: text });
    let address = "";
    dialog.append(h("h2", { id: "photograph-title" }, text), image, h("div", { class: "buttons" }, close));
    void answered(dialog, () => URL.revokeObjectURL(address));
    try {
      const file = await readFile(path);
      if (!dialog.open) return;
      address = URL.createObjectURL(file);
      image.src = address;
    } catch {
      image.replaceWith(h("p", { class: "notice bad", role: "alert" }, "The photograph could not be read."));
    }
  }
}
