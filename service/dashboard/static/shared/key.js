// @ts-check
// Asks for a key where the service wants one; it is kept for this tab only.

import { key } from "./api.js";
import { answered, h, quiet } from "./dom.js";

const ABOUT =
  "Its operator creates a key. The scope read allows you to look; the scope ingest also allows you to send:";

/** @type {(detail: string) => Promise<void>} resolves when a key has been given; `detail`: why it is asked for */
export function askForKey(detail) {
  const input = h("input", { id: "key", type: "password", autocomplete: "off", required: true, spellcheck: "false" });
  const form = h(
    "form",
    { method: "dialog" },
    h("h2", { id: "key-title" }, "This service asks for a key"),
    h("p", detail || ABOUT),
    h("pre", h("code", "clutchlife key create --scope read")),
    h("label", { for: "key" }, "Key"),
    input,
    quiet("It is kept in this tab until you close it, and sent to this service only."),
    h("div.row.buttons", h("button.main", "Use this key")),
  );
  const dialog = h("dialog", { "aria-labelledby": "key-title" }, form);
  dialog.addEventListener("cancel", (event) => event.preventDefault());
  return answered(dialog, () => key.set(input.value.trim()));
}
