// @ts-check
// What may be changed of what is stored of a clutch: each change is asked about, made, said at the foot of the window with the way
// back (the next change takes its place), and read again.

import { byId, h } from "../shared/dom.js";
import { problemView } from "../shared/problem_view.js";
import { answerDoubts, askArchive, askEnd, askInspection, askRun, askTakeBack, askUndo } from "./changes.js";

/** @import { ClutchOut, DeclaredEnd, InspectionOut, Receipt } from "../shared/types.js" */
/** @import { Answer, Done, RunAction } from "./changes.js" */

export class Stored {
  /**
   * @param {string} clutchId
   * @param {() => Promise<unknown>} refresh reads the clutch again
   */
  constructor(clutchId, refresh) {
    this.clutchId = clutchId;
    this.refresh = refresh;
  }

  /** @type {(action: RunAction, run: Receipt) => Promise<void>} */
  act = async (action, run) => showDone(await askRun(action, run), this.refresh);

  /** @type {(answer: Answer, runs: Receipt[]) => Promise<void>} */
  say = async (answer, runs) => showDone(await answerDoubts(answer, runs), this.refresh);

  /** @type {(run: Receipt) => Promise<void>} */
  undo = async (run) => showDone(await askUndo(run), this.refresh);

  /** @type {(inspection: InspectionOut) => Promise<void>} */
  change = async (inspection) => showDone(await askInspection(inspection), this.refresh);

  /** @param {boolean} archived what the clutch becomes */
  async archive(archived) {
    await showDone(await askArchive(this.clutchId, archived), this.refresh);
  }

  /**
   * Declare the end of the present life, or take back what was declared.
   * @param {DeclaredEnd | null} ended
   * @param {number} cycles of its last run
   */
  async end(ended, cycles) {
    const answer = ended === null ? askEnd(this.clutchId, cycles) : askTakeBack(this.clutchId, ended);
    await showDone(await answer, this.refresh);
  }

  /** @param {ClutchOut} clutch */
  showArchived(clutch) {
    const back = h("button", { type: "button", onclick: () => this.archive(false) }, "Bring it back …");
    const text = "This clutch is archived: it is not in the list of clutches and accepts no new runs.";
    byId("archived").replaceChildren(clutch.archived ? h("div", { class: "notice" }, h("p", {}, text), back) : "");
  }
}

/** @type {HTMLElement | null} */
let shown = null;

/**
 * @param {Done | null} done
 * @param {() => Promise<unknown>} refresh reads the clutch again
 */
async function showDone(done, refresh) {
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
