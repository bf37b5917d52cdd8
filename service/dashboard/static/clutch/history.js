// The tab of what has been: remaining life as it was predicted at each test, inspections, and the audit trail (who changed
// what, when and why; the newest first, page by page).

import { Chart, chartsOf } from "../charts/chart.js";
import { remainingCycles } from "../charts/life.js";
import { inspections } from "../inspections/inspections.js";
import { clutchPath, readAll } from "../shared/api.js";
import { button, h, quiet, scrolling, section, table } from "../shared/dom.js";
import { files } from "../shared/files.js";
import { fixed, moment, words } from "../shared/format.js";
import { askInspection } from "./changes.js";
import { runLink } from "./warnings.js";

/** @import { Page, Tab } from "./clutch.js" */

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

/** @type {(place: HTMLElement, clutchId: string) => (runs: Receipt[]) => Promise<void>} reads the pages shown */
function auditTrail(place, clutchId) {
  const path = /** @type {const} */ (`${clutchPath(clutchId)}/changes`);
  let pages = 1;
  return async function show(runs) {
    const { items, more } = await readAll(`${path}?limit=${PAGE}`, pages);
    const named = new Map(runs.map((run) => [run.run_id, run]));
    /** @param {string | null} id */
    const subject = (id) => {
      const run = named.get(id ?? "");
      return run ? runLink(run) : id === null ? "the clutch" : id;
    };
    const rows = items.map((change) => [
      moment(change.at),
      actionText(change),
      subject(change.run_id),
      change.by === "local" ? "this machine" : change.by.replace(/^key:\s*/, "key "),
      change.reason || "–",
    ]);
    const next = () => {
      pages += 1;
      show(runs);
    };
    const saved = files(`${clutchId}-changes`, `${path}.csv`);
    place.replaceChildren(
      rows.length === 0
        ? quiet("Nothing was held, corrected, withdrawn, edited or adopted.")
        : quiet("Who changed what and why, the newest first. ", saved),
      rows.length > 0 ? h("div.panel", scrolling("Changes", table("Changes", COLUMNS, rows))) : "",
      more ? button("Show earlier changes", next) : "",
    );
  };
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

/** @type {(place: HTMLElement, page: Page) => Tab} */
export function historyTab(place, { reader, done }) {
  const predicted = new Chart({ id: "predicted", title: "Remaining cycles, as predicted", wide: true });
  const [inspected, changed] = [h("div"), h("div")];
  place.append(
    section("predictions", "Earlier predictions", chartsOf(predicted)),
    section("inspections", "Inspections", inspected),
    section("changes", "Changes", changed),
  );
  const showInspections = inspections(inspected, reader, (one) => done(askInspection(one)));
  const showChanges = auditTrail(changed, reader.id);
  /** Inspections come without a change of the clutch. */
  const poll = async () => showInspections(await reader.events());
  const showPredictions = async () => predicted.show(remainingCycles(await reader.forecast()));
  return {
    poll,
    show: async () => {
      predicted.element.hidden = reader.present().runs === 0;
      const changes = reader.runs().then(showChanges);
      await Promise.all([poll(), changes, !predicted.element.hidden && showPredictions()]);
    },
  };
}
