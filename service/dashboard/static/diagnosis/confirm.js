// @ts-check
// A question before something changes, which says what will change.

import { answered, h } from "../shared/dom.js";
import { lifeBars } from "./lifebars.js";

/** @import { BeforeAndAfter } from "../shared/types.js" */

/** @typedef {{ title: string, points: string[], action: string, life?: BeforeAndAfter | null }} Question */

/**
 * Resolves to whether the reader agrees.
 * @param {Question} question
 * @returns {Promise<boolean>}
 */
export function confirm({ title, points, action, life = null }) {
  const items = points.map((point) => h("li", {}, point));
  const dialog = h(
    "dialog",
    { class: "narrow", "aria-labelledby": "confirm-title" },
    h("h2", { id: "confirm-title" }, title),
    h("ul", {}, items),
    life && lifeBars(life, ["Now", "Then"]),
    h(
      "form",
      { method: "dialog", class: "buttons" },
      h("button", { value: "no" }, "Leave it as it is"),
      h("button", { value: "yes", class: "main" }, action),
    ),
  );
  return answered(dialog, () => dialog.returnValue === "yes");
}
