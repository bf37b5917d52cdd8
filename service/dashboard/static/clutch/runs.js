// @ts-check
// The tab of the runs: every run with its state, its receipt, its curves and what can be done to it, the latest cycles first, page
// by page. `#/runs/RUN` opens one.

import { doubtList, fitTable, loopTable, warnings } from "../sending/receipt.js";
import { button, h, quiet } from "../shared/dom.js";
import { files } from "../shared/files.js";
import { fixed, kindName, moment, words } from "../shared/format.js";
import { askUndo, isCorrected, stateMark } from "./changes.js";
import { buttons } from "./warnings.js";
import { runCharts } from "./run_view.js";

/** @import { Receipt } from "../shared/types.js" */
/** @import { Page } from "./clutch.js" */

/** Runs on a page of the list. */
const PAGE = 25;

export class Runs {
  /**
   * @param {HTMLElement} place
   * @param {Page} page
   */
  constructor(place, { reader, done }) {
    this.place = place;
    this.reader = reader;
    this.done = done;
    this.first = 0;
    /** @type {Receipt[]} the latest first */
    this.runs = [];
    /** @type {Set<string>} */
    this.open = new Set();
    this.revealed = "";
  }

  /** @param {string} runId that the address opens */
  async show(runId) {
    const focused = this.focusedRun();
    this.runs = [...(await this.reader.runs())].reverse();
    if (runId && runId !== this.revealed) this.reveal(runId);
    else this.draw();
    this.revealed = runId;
    if (focused !== null) this.summaryOf(focused)?.focus({ preventScroll: true });
  }

  /** The run whose part of the list has the focus, which drawing takes away. */
  focusedRun() {
    const inside = this.place.contains(document.activeElement) ? document.activeElement : null;
    return inside?.closest("details")?.dataset.run ?? null;
  }

  /** @param {string} runId */
  summaryOf(runId) {
    const details = [...this.place.querySelectorAll("details")].find((element) => element.dataset.run === runId);
    return details?.querySelector("summary") ?? null;
  }

  /** @type {(runId: string) => void} show a run, opened */
  reveal(runId) {
    const index = this.runs.findIndex((run) => run.run_id === runId);
    if (index < 0) return;
    this.first = PAGE * Math.floor(index / PAGE);
    this.open.add(runId);
    this.draw();
    const summary = this.summaryOf(runId);
    summary?.scrollIntoView({ block: "center" });
    summary?.focus({ preventScroll: true });
  }

  draw() {
    const { length } = this.runs;
    if (this.first >= length) this.first = 0;
    const listed = this.runs.slice(this.first, this.first + PAGE);
    this.place.replaceChildren(
      quiet(`${this.summary()} `, files(`${this.reader.name()}-runs`, `${this.reader.path}/runs.csv`)),
      h(
        "div",
        { class: "runs" },
        listed.map((run) => this.item(run)),
      ),
      length > PAGE ? this.pager() : "",
    );
  }

  summary() {
    const { runs } = this;
    const warned = runs.filter((run) => run.warnings.length > 0).length;
    const [held, withdrawn] = ["held", "withdrawn"].map((state) => runs.filter((run) => run.state === state).length);
    const parts = [`${runs.length} ${runs.length === 1 ? "run" : "runs"}`, `${warned} with warnings`];
    if (held > 0) parts.push(`${held} held`);
    if (withdrawn > 0) parts.push(`${withdrawn} withdrawn`);
    return `${parts.join(", ")}.`;
  }

  pager() {
    const last = Math.min(this.first + PAGE, this.runs.length);
    /** @type {(label: string, first: number) => HTMLElement} */
    const turn = (label, first) => {
      const go = () => {
        this.first = first;
        this.draw();
        this.place.scrollIntoView({ block: "start" });
        this.place.querySelector("summary")?.focus({ preventScroll: true });
      };
      return button(label, go, { disabled: first < 0 || first >= this.runs.length });
    };
    return h(
      "nav",
      { class: "buttons start", "aria-label": "Pages of runs" },
      turn("Later runs", this.first - PAGE),
      turn("Earlier runs", this.first + PAGE),
      h("span", { class: "quiet" }, `${this.first + 1} to ${last} of ${this.runs.length}, the latest first`),
    );
  }

  /** @param {Receipt} run */
  item(run) {
    const inside = h("div", { class: "inside" });
    const count = run.warnings.length;
    const warned = count > 0 ? `${count} ${count === 1 ? "warning" : "warnings"}` : "";
    const name = run.state === "withdrawn" ? "s" : "span";
    const details = h(
      "details",
      { open: this.open.has(run.run_id), "data-run": run.run_id, class: `run-${run.state}` },
      h(
        "summary",
        {},
        h(name, { class: "at" }, `${fixed(run.cycles)} cycles`),
        h(name, {}, nameOf(run)),
        h("span", {}, stateMark(run) || resultOf(run)),
        h("span", { class: count > 0 ? "warned" : "quiet" }, warned),
        h("span", { class: "quiet" }, moment(run.started_at ?? run.received_at)),
      ),
      inside,
    );
    details.addEventListener("toggle", () => {
      if (details.open) this.open.add(run.run_id);
      else this.open.delete(run.run_id);
      if (details.open && !inside.hasChildNodes()) this.fill(inside, run);
    });
    return details;
  }

  /** @type {(inside: HTMLElement, run: Receipt) => Promise<void>} */
  async fill(inside, run) {
    const charts = h("div", { class: "run-charts" });
    inside.append(...this.inside(run), charts, ...receipt(run));
    if (run.kind === "maintenance") return;
    charts.append((await runCharts(run, this.reader)) ?? "");
  }

  /** @param {Receipt} run */
  inside(run) {
    const changes = buttons(run, this.done);
    if (isCorrected(run) && run.state !== "withdrawn") {
      changes.append(button("Undo the correction …", () => this.done(askUndo(run))));
    }
    return [
      run.state === "held" ? h("p", {}, "Held: it does not count until it is confirmed or corrected.") : "",
      run.state === "withdrawn" ? h("p", {}, "Withdrawn: it does not count.") : "",
      isCorrected(run)
        ? h("p", {}, `Sent as ${fixed(run.sent_cycles)} cycles, corrected to ${fixed(run.cycles)}.`)
        : "",
      run.doubts.length > 0
        ? h("div", {}, run.state === "held" ? "" : h("b", {}, "It was held because:"), doubtList(run))
        : "",
      changes,
    ];
  }
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
  if (loops.length > 0) return `${loops.length} ${loops.length === 1 ? "loop" : "loops"}`;
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
  const list = facts.flatMap(([name, value]) => [h("dt", {}, name), h("dd", {}, value)]);
  return [
    warnings(run.warnings) ?? "",
    run.fits.length > 0 ? fitTable(run.fits) : "",
    run.loops.length > 0 ? loopTable(run.loops) : "",
    h("dl", { class: "facts" }, list),
  ];
}
