// @ts-check
// Files on their way in: chosen by a button, or dropped anywhere on the page.

import { h } from "../shared/dom.js";

/**
 * Make a button and the whole page take files, several at once.
 * @type {(button: HTMLElement, take: (files: File[]) => unknown) => void}
 */
export function takeFiles(button, take) {
  const chooser = h("input", { type: "file", multiple: true, hidden: true, "aria-label": "Run files" });
  chooser.addEventListener("change", () => {
    if (chooser.files?.length) take([...chooser.files]);
  });
  document.body.append(chooser);
  button.addEventListener("click", () => {
    chooser.value = "";
    chooser.click();
  });
  takeDropped(take);
}

/** @param {(files: File[]) => unknown} take */
function takeDropped(take) {
  let depth = 0;
  /** @param {number} level elements entered and not yet left */
  const setDepth = (level) => {
    depth = level;
    document.body.classList.toggle("dropping", depth > 0);
  };
  /** @param {DragEvent} event */
  const hasFiles = (event) => event.dataTransfer?.types.includes("Files") ?? false;
  addEventListener("dragenter", (event) => {
    if (hasFiles(event)) setDepth(depth + 1);
  });
  addEventListener("dragleave", () => setDepth(Math.max(0, depth - 1)));
  addEventListener("dragover", (event) => {
    if (hasFiles(event)) event.preventDefault();
  });
  addEventListener("drop", (event) => {
    if (!hasFiles(event)) return;
    event.preventDefault();
    setDepth(0);
    if (document.querySelector("dialog[open]")) return; // one question at a time
    const files = [...(event.dataTransfer?.files ?? [])];
    if (files.length > 0) take(files);
  });
}
