// @ts-check
// The tab of what has been: remaining life as it was predicted at each test, inspections, and the audit trail (who changed
// what, when and why; the newest first, page by page).

import { Chart } from "../charts/chart.js";
import { remainingCycles } from "../charts/life.js";
import { Inspections } from "../inspections/inspections.js";
import { clutchPath, read } from "../shared/api.js";
import { button, h, quiet, scrolling, table, within } from "../shared/dom.js";
import { files } from "../shared/files.js";
import { fixed, moment, words } from "../shared/format.js";
import { askInspection } from "./changes.js";
import { runLink } from "./warnings.js";

/** @import { Change, ListPage, Receipt } from "../shared/types.js" */
/** @import { Page } from "./clutch.js" */

const PAGE = 20;
const COLUMNS = ["When", "What", "Run", "Who", "Why"];

/** @type {Record<string, string>} */
const ACTIONS = {
  hold: "Held on arrival",
  accept: "Accepted: other runs agree",
  doubt: "Held: other runs disagree",
  confirm: "Confirmed",
  withdraw: "Withdrawn",
  restore: "Restored",
  correct: "Cycles corrected",
  reread: "Read again",
  edit: "Clutch edited",
  archive: "Archived",
  unarchive: "Brought back",
  adopt: "Model adopted",
  withdraw_inspection: "Inspection withdrawn",
  restore_inspection: "Inspection restored",
};

class AuditTrail {
  /**
   * @param {HTMLElement} place
   * @param {string} clutchId
   */
  constructor(place, clutchId) {
    this.place = place;
    this.clutchId = clutchId;
    this.pages = 1;
  }

  /** Read as many pages as are shown. */
  async read() {
    /** @type {Change[]} */
    const changes = [];
    /** @type {string | null} */
    let cursor = null;
    for (let page = 0; page < this.pages && (page === 0 || cursor !== null); page += 1) {
      /** @type {string} */
      const more = cursor === null ? "" : `&cursor=${encodeURIComponent(cursor)}`;
      /** @type {{ body: ListPage<Change> }} */
      const { body } = await read(`${clutchPath(this.clutchId)}/changes?limit=${PAGE}${more}`);
      changes.push(...body.items);
      cursor = body.next ?? null;
    }
    return { changes, more: cursor !== null };
  }

  /** @param {Receipt[]} runs */
  async show(runs) {
    const { changes, more } = await this.read();
    const named = new Map(runs.map((run) => [run.run_id, run]));
    /** @param {string | null} id */
    const subject = (id) => {
      const run = named.get(id ?? "");
      return run ? runLink(run) : id === null ? "the clutch" : id;
    };
    const rows = changes.map((change) => [
      moment(change.at),
      actionText(change),
      subject(change.run_id),
      change.by === "local" ? "this machine" : change.by.replace(/^key:\s*/, "key "),
      change.reason || "–",
    ]);
    const next = () => {
      this.pages += 1;
      this.show(runs);
    };
    this.place.replaceChildren(
      changes.length === 0
        ? quiet("Nothing was held, corrected, withdrawn, edited or adopted.")
        : quiet(
            "Who changed what and why, the newest first. ",
            files(`${this.clutchId}-changes`, `${clutchPath(this.clutchId)}/changes.csv`),
          ),
      rows.length > 0 ? h("div", { class: "panel" }, scrolling("Changes", table("Changes", COLUMNS, rows))) : "",
      more ? button("Show earlier changes", next) : "",
    );
  }
}

/** @param {Change} change */
function actionText({ action, before, after }) {
  const name = ACTIONS[action] ?? words(action);
  if (action === "reread") return `${name} by rig ${shown(after.rig)}`;
  if (action === "correct") return `${name}: ${shown(before.cycles)} to ${shown(after.cycles)}`;
  if (action === "adopt" && after.diagnosis_id === null) return "Back to the baseline model";
  if (action !== "edit") return name;
  const fields = Object.keys(after).filter((key) => JSON.stringify(after[key]) !== JSON.stringify(before[key]));
  return `${name}: ${fields.map((key) => `${words(key).toLowerCase()} ${shown(before[key])} to ${shown(after[key])}`).join("; ")}`;
}

/** @param {unknown} value */
function shown(value) {
  if (typeof value === "number") return Number.isInteger(value) ? fixed(value) : String(value);
  if (value === null || typeof value !== "object") return String(value ?? "–");
  return Object.entries(value)
    .map(([key, part]) => `${words(key).toLowerCase()} ${part}`)
    .join(", ");
}

export class History {
  /** @param {Page} page */
  constructor({ reader, done }) {
    this.reader = reader;
    const { name } = reader;
    this.predicted = new Chart({ name, id: "predicted", title: "Remaining cycles, as predicted", wide: true });
    within("predictions", ".charts").append(this.predicted.element);
    this.inspections = new Inspections(within("inspections", ".body"), reader.id, name, (inspection) =>
      done(askInspection(inspection)),
    );
    this.audit = new AuditTrail(within("changes", ".body"), reader.id);
  }

  async show() {
    const { runs: counted } = this.reader.present();
    this.predicted.element.hidden = counted === 0;
    await Promise.all([this.poll(), this.showChanges(), counted > 0 && this.showPredictions()]);
  }

  async showChanges() {
    await this.audit.show(await this.reader.runs());
  }

  async showPredictions() {
    this.predicted.show(remainingCycles(await this.reader.forecast()));
  }

  /** Inspections come without a change of the clutch. */
  async poll() {
    await this.inspections.poll(await this.reader.events());
  }
}
