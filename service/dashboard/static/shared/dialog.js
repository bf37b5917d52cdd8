// Questions in a dialog: each has a form that is sent, or is left.

import { answered, button, form, h } from "./dom.js";
import { attempted } from "./problem_view.js";

/** @import { Content } from "./dom.js" */

/**
 * @template Result
 * @typedef {object} Question
 * @property {string} title
 * @property {Content[]} [lines] what stands above the form
 * @property {Content} [fields]
 * @property {string} action the button's word
 * @property {string | null} [leave] the other button's word; null: there is none, and the question is not left
 * @property {string} [size] of the dialog
 * @property {string} [lead] what has not happened where it is refused
 * @property {() => Promise<Result> | Result} send a Problem of it is shown, and the dialog stays
 */

/**
 * Resolves to what `send` gives, null where the reader leaves it.
 * @template Result
 * @param {Question<Result>} question
 * @returns {Promise<Result | null>}
 */
export function asked({ title, lines = [], fields = [], action, leave = "Cancel", size = "narrow", lead, send }) {
  const answer = h("div.answer", { "aria-live": "polite" });
  const go = h("button.main", action);
  const dialog = h("dialog", { class: size, "aria-label": title });
  if (leave === null) dialog.addEventListener("cancel", (event) => event.preventDefault());
  /** @type {Result | null} */
  let result = null;
  const work = async () => {
    result = await send();
    dialog.close();
  };
  const submit = () => attempted([go], answer, "Computing …", work, lead ?? "Nothing was changed. ");
  const cancel = leave !== null && button(leave, () => dialog.close());
  const buttons = h("div.row.buttons", cancel, go);
  dialog.append(h("h2", title), h("div", ...lines), form(submit, h("div.fields", fields), answer, buttons));
  return answered(dialog, () => result);
}

/**
 * Whether the reader agrees to what will happen.
 * @param {{ title: string, points: string[], action: string, more?: Content }} question
 */
export async function agreed({ title, points, action, more = null }) {
  const items = points.map((point) => h("li", point));
  const lines = [h("ul", items), more];
  return (await asked({ title, lines, action, leave: "Leave it as it is", send: () => true })) === true;
}
