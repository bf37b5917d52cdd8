// @ts-check
// What is stored of the clutch and what may be changed: held runs and warnings at the top, the list of runs, the audit trail.

import { byId, h, within } from "../shared/dom.js";
import { AuditTrail } from "./audit.js";
import { answerDoubts, askArchive, askEnd, askInspection, askRun, askTakeBack, askUndo } from "./changes.js";
import { showDone } from "./done.js";
import { heldView } from "./held.js";
import { RunList } from "./runs.js";
import { lifeWarnings, warningsView } from "./warnings.js";

/** @import { ClutchOut, DeclaredEnd, InspectionOut, Receipt, StribeckItem, Warned } from "../shared/types.js" */
/** @import { Answer, RunAction } from "./changes.js" */

export class Stored {
  /**
   * @param {string} clutchId
   * @param {() => Promise<unknown>} refresh reads the clutch again
   */
  constructor(clutchId, refresh) {
    this.clutchId = clutchId;
    this.refresh = refresh;
    this.shown = false;
    this.list = new RunList(within("runs", ".body"), clutchId, { act: this.act, undo: this.undo });
    this.audit = new AuditTrail(within("runs", ".changes"), clutchId, this.reveal);
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

  /** @type {(runId: string) => void} */
  reveal = (runId) => this.list.reveal(runId);

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
    const text = "This clutch is archived: it is not in the list of clutches and takes no new runs.";
    byId("archived").replaceChildren(clutch.archived ? h("div", { class: "notice" }, h("p", {}, text), back) : "");
  }

  /** @param {{ runs: Receipt[], tests: StribeckItem[], warned: Warned[] }} answers */
  showWarnings(answers) {
    const odd = lifeWarnings(answers);
    fill("warnings", odd.length > 0 ? warningsView(odd, this.reveal) : null);
  }

  /** @param {Receipt[]} runs by cycles */
  async show(runs) {
    const held = runs.filter((run) => run.state === "held").reverse();
    fill("held", held.length > 0 ? heldView(held, this) : null);
    if (!this.shown && location.hash === "#held") byId("held").scrollIntoView();
    this.shown = true;
    this.list.show(runs);
    await this.audit.show(runs);
  }
}

/**
 * @param {string} section
 * @param {HTMLElement | null} content null hides it
 */
function fill(section, content) {
  const place = byId(section);
  place.hidden = content === null;
  place.replaceChildren(content ?? "");
}
