// A button and the whole page take files. What sends them is loaded when the first ones come: most visits send nothing.

import { h } from "../shared/dom.js";

/** @typedef {{ clutch?: string, sent: () => unknown }} Page without a clutch the reader names it; `sent`: hears of stored runs */

/** @type {(button: HTMLElement, page: Page) => void} make a button and the whole page take files */
export function sender(button, page) {
  takeFiles(button, async (files) => (await import("./sending.js")).sendFiles(files, page));
}

/** @type {(button: HTMLElement, take: (files: File[]) => unknown) => void} from a button and dropped on the page */
function takeFiles(button, take) {
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
