// A question before something changes, which says what will change.

import { h } from "./dom.js";
import { lifeBars } from "./lifebars.js";

/** Resolves to whether the reader agrees. */
export function confirm({ title, points, action, life = null }) {
  const dialog = h("dialog", { class: "narrow", "aria-labelledby": "confirm-title" },
    h("h2", { id: "confirm-title" }, title),
    h("ul", {}, points.map((point) => h("li", {}, point))),
    life ? lifeBars(life, ["Now", "Then"]) : null,
    h("form", { method: "dialog", class: "buttons" }, h("button", { value: "no" }, "Leave it as it is"), h("button", { value: "yes", class: "main" }, action)));
  document.body.append(dialog);
  dialog.showModal();
  return new Promise((said) => {
    dialog.addEventListener("close", () => { said(dialog.returnValue === "yes"); dialog.remove(); });
  });
}
