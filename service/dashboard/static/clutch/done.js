// @ts-check
// What was just done, at the foot of the window, with the way back; the next change takes its place.

import { h } from "../shared/dom.js";
import { problemView } from "../shared/problem_view.js";

/** @import { Done } from "./changes.js" */

/** @type {HTMLElement | null} */
let shown = null;

/**
 * @param {Done | null} done
 * @param {() => Promise<unknown>} refresh reads the clutch again
 */
export async function showDone(done, refresh) {
  if (done === null) return;
  shown?.remove();
  const { text, undo } = done;
  const place = h("div", { class: "done", role: "status", tabindex: "-1" });
  const close = () => place.remove();
  const goBack = async () => {
    try {
      await showDone(undo && (await undo()), refresh);
    } catch (problem) {
      place.replaceChildren(problemView(problem, "Not undone. "), dismiss());
    }
  };
  const dismiss = () => h("button", { type: "button", onclick: close }, "Close");
  document.body.append(place);
  place.append(h("p", {}, text), undo ? h("button", { type: "button", onclick: goBack }, "Undo") : "", dismiss());
  shown = place;
  place.focus({ preventScroll: true });
  await refresh();
}
