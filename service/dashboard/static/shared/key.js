// @ts-check
// Asks for a key where the service wants one; it is kept for this tab only.

import { key, Problem } from "./api.js";
import { answered, h } from "./dom.js";

/** @type {(problem: Problem) => Promise<void>} resolves when a key has been given */
function askForKey(problem) {
  const input = h("input", { id: "key", type: "password", autocomplete: "off", required: true, spellcheck: "false" });
  const dialog = h(
    "dialog",
    { "aria-labelledby": "key-title" },
    h(
      "form",
      { method: "dialog" },
      h("h2", { id: "key-title" }, "This service asks for a key"),
      h(
        "p",
        {},
        problem.detail ||
          "Its operator creates a key. The scope read allows you to look; the scope ingest also allows you to send:",
      ),
      h("pre", {}, h("code", {}, "clutchlife key create --scope read")),
      h("label", { for: "key" }, "Key"),
      input,
      h("p", { class: "quiet" }, "It is kept in this tab until you close it, and sent to this service only."),
      h("div", { class: "buttons" }, h("button", { class: "main" }, "Use this key")),
    ),
  );
  dialog.addEventListener("cancel", (event) => event.preventDefault());
  return answered(dialog, () => key.set(input.value.trim()));
}

/**
 * `poll`, asking for a key and polling again where one is needed.
 * @param {() => Promise<void>} poll
 */
export function withKey(poll) {
  return async () => {
    for (;;) {
      try {
        return await poll();
      } catch (error) {
        if (!(error instanceof Problem && error.needsKey)) throw error;
        await askForKey(error);
      }
    }
  };
}
