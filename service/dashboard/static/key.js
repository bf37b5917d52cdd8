// Asks for a key where the service wants one; it is kept for this tab only.

import { key } from "./api.js";
import { h } from "./dom.js";

/** Resolves when a key has been given. */
export function askForKey(problem) {
  const input = h("input", { id: "key", type: "password", autocomplete: "off", required: true, spellcheck: "false" });
  const dialog = h("dialog", { "aria-labelledby": "key-title" },
    h("form", { method: "dialog" },
      h("h2", { id: "key-title" }, "This service asks for a key"),
      h("p", {}, problem.detail || "Its operator makes one, with the scope read to look and ingest to send:"),
      h("pre", {}, h("code", {}, "clutchlife key create --scope read")),
      h("label", { for: "key" }, "Key"), input,
      h("p", { class: "quiet" }, "It is kept in this tab until you close it, and sent to this service only."),
      h("div", { class: "buttons" }, h("button", { class: "main" }, "Use this key"))));
  dialog.addEventListener("cancel", (event) => event.preventDefault());
  document.body.append(dialog);
  dialog.showModal();
  return new Promise((given) => {
    dialog.addEventListener("close", () => {
      key.set(input.value.trim());
      dialog.remove();
      given();
    });
  });
}

/** `look`, asking for a key and looking again where one is needed. */
export function withKey(look) {
  return async () => {
    for (;;) {
      try {
        return await look();
      } catch (error) {
        if (!error.needsKey) throw error;
        await askForKey(error);
      }
    }
  };
}
