// The photographs of the inspections as thumbnails, by state; each opens larger. Their files are read with the reader's key
// when they come to the screen, one after the other, and kept by the browser: a photograph never changes. Of each the page
// keeps a drawing as small as its thumbnail, and the whole of one while it is open.

import { readFile } from "../shared/api.js";
import { answered, button, h, watch } from "../shared/dom.js";
import { fixed } from "../shared/format.js";

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

/** @param {string} base the inspections' path */
export function gallery(base) {
  const element = h("div.row.photographs");
  /** @type {Map<string, HTMLCanvasElement>} the drawings that are shown, by path */
  const drawings = new Map();
  // what is being read and drawn: a photograph at a time, as one of 24 megapixels takes 100 MB while it is drawn
  let queue = Promise.resolve();

  /** @param {InspectionOut} inspection */
  function state({ inspection_id: id, cycles, lining, photographs }) {
    const place = `${fixed(cycles)} cycles${lining ? `, ${lining}` : ""}`;
    const thumbnails = photographs.map((photograph, index) => {
      const path = `${base}/${id}/photographs/${photograph.photograph_id}`;
      return thumbnail({ path, text: `Photograph ${index + 1} of ${photographs.length} at ${place}` });
    });
    return h("figure", h("figcaption", `At ${place}`), h("div.row.thumbnails", thumbnails));
  }

  /** @param {Shown} photograph */
  function thumbnail(photograph) {
    const drawing = drawings.get(photograph.path);
    const attributes = { class: "thumbnail", "aria-label": `${photograph.text}: show it larger` };
    const made = button(drawing, () => open(photograph), attributes);
    watch(made, 300, (near) => {
      if (near) queue = queue.then(() => draw(made, photograph.path));
    });
    return made;
  }

  /** @type {(place: HTMLElement, path: string) => Promise<void>} once, and where it is shown still */
  async function draw(place, path) {
    if (place.hasChildNodes() || !place.isConnected) return;
    try {
      const drawing = drawings.get(path) ?? (await drawn(await readFile(path)));
      place.replaceChildren(drawing);
      drawings.set(path, drawing);
    } catch {
      place.replaceChildren("could not be read");
    }
  }

  return {
    element,
    show: (/** @type {InspectionOut[]} */ inspections) => {
      element.replaceChildren(...inspections.filter(({ photographs }) => photographs.length > 0).map(state));
      for (const [path, drawing] of drawings) if (!drawing.isConnected) drawings.delete(path);
    },
  };
}

/** @param {Shown} photograph */
async function open({ path, text }) {
  const dialog = h("dialog.photograph", { "aria-labelledby": "photograph-title" });
  const close = button("Close", () => dialog.close(), { class: "main" });
  const image = h("canvas", { role: "img", "aria-label": text });
  dialog.append(h("h2", { id: "photograph-title" }, text), image, h("div.row.buttons", close));
  void answered(dialog, () => null);
  try {
    const picture = await createImageBitmap(await readFile(path));
    [image.width, image.height] = [picture.width, picture.height];
    image.getContext("bitmaprenderer")?.transferFromImageBitmap(picture);
  } catch {
    image.replaceWith(h("p.notice.bad", { role: "alert" }, "The photograph could not be read."));
  }
}
