// The tab of the runs: every run with its state, its receipt, its curves and what can be done to it, the latest cycles first, page
// by page. `#/runs/RUN` opens one.

import { doubtList, fitTable, loopTable, warnings } from "../sending/receipt.js";
import { button, h, quiet, section } from "../shared/dom.js";
import { files } from "../shared/files.js";
import { counted, fixed, kindName, moment, words } from "../shared/format.js";
import { askUndo, isCorrected, stateMark } from "./changes.js";
import { buttons } from "./warnings.js";
import { runCharts } from "./run_view.js";

/** @import { Page, Tab } from "./clutch.js" */

/** Runs on a page of the list. */
const PAGE = 25;

/** @type {(tab: HTMLElement, page: Page) => Tab} */
export function runsTab(tab, { reader, done }) {
  const place = h("div");
  tab.append(section("runs", "Runs and events", place));
  let first = 0;
  /** @type {Receipt[]} the latest first */
  let runs = [];
  /** @type {Set<string>} */
  const open = new Set();
  let revealed = "";

  /** @type {(runId: string) => HTMLElement | null} */
  const summaryOf = (runId) => place.querySelector(`[data-run="${CSS.escape(runId)}"] > summary`);

  /** @type {(runId: string) => void} show a run, opened */
  function reveal(runId) {
    const index = runs.findIndex((run) => run.run_id === runId);
    if (index < 0) return;
    first = PAGE * Math.floor(index / PAGE);
    open.add(runId);
    draw();
    const summary = summaryOf(runId);
    summary?.scrollIntoView({ block: "center" });
    summary?.focus({ preventScroll: true });
  }

  function draw() {
    if (first >= runs.length) first = 0;
    const listed = runs.slice(first, first + PAGE).map((run) => item(run));
    const saved = files(`${reader.id}-runs`, `${reader.path}/runs.csv`);
    const pages = runs.length > PAGE ? pager() : "";
    place.replaceChildren(quiet(`${countsOf(runs)} `, saved), h("div.runs", listed), pages);
  }

  function pager() {
    const last = Math.min(first + PAGE, runs.length);
    /** @type {(label: string, start: number) => HTMLElement} */
    const turn = (label, start) => {
      const go = () => {
        first = start;
        draw();
        place.scrollIntoView({ block: "start" });
        place.querySelector("summary")?.focus({ preventScroll: true });
      };
      return button(label, go, { disabled: start < 0 || start >= runs.length });
    };
    return h(
      "nav.row.buttons.start",
      { "aria-label": "Pages of runs" },
      turn("Later runs", first - PAGE),
      turn("Earlier runs", first + PAGE),
      h("span.quiet", `${first + 1} to ${last} of ${runs.length}, the latest first`),
    );
  }

  /** @param {Receipt} run */
  function item(run) {
    const inside = h("div.inside");
    const count = run.warnings.length;
    const name = run.state === "withdrawn" ? "s" : "span";
    const summary = h(
      "summary",
      h(name, { class: "number" }, `${fixed(run.cycles)} cycles`),
      h(name, nameOf(run)),
      h("span", stateMark(run) || resultOf(run)),
      h("span", { class: count > 0 ? "warned" : "quiet" }, count > 0 && counted(count, "warning")),
      h("span.quiet", moment(run.started_at ?? run.received_at)),
    );
    const ontoggle = () => {
      if (details.open) open.add(run.run_id);
      else open.delete(run.run_id);
      if (details.open && !inside.hasChildNodes()) fill(inside, run);
    };
    const attributes = { open: open.has(run.run_id), "data-run": run.run_id, class: `run-${run.state}`, ontoggle };
    const details = h("details", attributes, summary, inside);
    return details;
  }

  /** @type {(inside: HTMLElement, run: Receipt) => Promise<void>} */
  async function fill(inside, run) {
    const charts = h("div.run-charts");
    const changes = buttons(run, done);
    if (isCorrected(run) && run.state !== "withdrawn") {
      changes.append(button("Undo the correction …", () => done(askUndo(run))));
    }
    inside.append(...statesOf(run), changes, charts, ...receipt(run));
    if (run.kind !== "maintenance") charts.append((await runCharts(run, reader)) ?? "");
  }

  async function show(/** @type {string} */ runId) {
    // the run whose part of the list has the focus, which drawing takes away
    const inside = place.contains(document.activeElement) ? document.activeElement : null;
    const focused = inside?.closest("details")?.dataset.run;
    runs = [...(await reader.runs())].reverse();
    if (runId && runId !== revealed) reveal(runId);
    else draw();
    revealed = runId;
    if (focused !== undefined) summaryOf(focused)?.focus({ preventScroll: true });
  }

  return { show };
}

/** @param {Receipt[]} runs */
function countsOf(runs) {
  const warned = runs.filter((run) => run.warnings.length > 0).length;
  const [held, withdrawn] = ["held", "withdrawn"].map((state) => runs.filter((run) => run.state === state).length);
  const parts = [counted(runs.length, "run"), `${warned} with warnings`];
  if (held > 0) parts.push(`${held} held`);
  if (withdrawn > 0) parts.push(`${withdrawn} withdrawn`);
  return `${parts.join(", ")}.`;
}

/** @type {(run: Receipt) => HTMLElement[]} why a run does not count, or counts otherwise than it was sent */
function statesOf(run) {
  const held = run.state === "held";
  const sent = `Sent as ${fixed(run.sent_cycles)} cycles, corrected to ${fixed(run.cycles)}.`;
  return [
    held && h("p", "Held: it does not count until it is confirmed or corrected."),
    run.state === "withdrawn" && h("p", "Withdrawn: it does not count."),
    isCorrected(run) && h("p", sent),
    run.doubts.length > 0 && h("div", !held && h("b", "It was held because:"), doubtList(run)),
  ].filter((part) => part !== false);
}

/** @param {Receipt} run */
function nameOf({ kind, event, note }) {
  return kind === "maintenance" ? `${words(event)}${note ? `: ${note}` : ""}` : kindName(kind);
}

/** @param {Receipt} run */
function resultOf({ kind, fits, loops, duty }) {
  if (duty) {
    const energy = duty.energy_per_cycle_kj ? ` of ${fixed(duty.energy_per_cycle_kj, 1)} kJ` : "";
    return `${fixed(duty.cycles)} cycles${energy}`;
  }
  if (fits.length > 0) return `${fits.filter((fit) => fit.acceptable).length} of ${fits.length} fits acceptable`;
  if (loops.length > 0) return counted(loops.length, "loop");
  return kind === "maintenance" ? "" : "no curve";
}

/** @param {Receipt} run */
function receipt(run) {
  const facts = [
    ["Run", run.run_id],
    ["Received", moment(run.received_at)],
    ["Origin", run.origin],
    ["SHA-256", run.content_sha256],
    ["Computed by", `version ${run.code_version}`],
  ];
  const list = facts.flatMap(([name, value]) => [h("dt", name), h("dd", value)]);
  return [
    warnings(run.warnings) ?? "",
    run.fits.length > 0 ? fitTable(run.fits) : "",
    run.loops.length > 0 ? loopTable(run.loops) : "",
    h("dl.facts", list),
  ];
}
