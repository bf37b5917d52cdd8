// @ts-check
// Remaining life by any tracked quantity: a choice of quantity and pressure, answered when it is made. Nothing is stored.

import { choice, setControls } from "../charts/chart.js";
import { distinct } from "../charts/columns.js";
import { PARAMETER_NAMES } from "../charts/parameters.js";
import { clutchPath, Problem, read } from "../shared/api.js";
import { h, quiet, scrolling, table } from "../shared/dom.js";
import { cycles, interval } from "../shared/format.js";
import { problemView } from "../shared/problem_view.js";
import { levelOptions, usual } from "./choices.js";
import { criterionRow, OWN_COLUMNS } from "./criteria.js";
import { LAG_NAMES } from "./lag.js";
import { QUANTITIES } from "./names.js";

/** @import { CriterionOutcome, LoopItem, RemainingLife, StribeckItem } from "../shared/types.js" */

/** @type {string[]} */
const OF_CURVES = ["mean_cof", ...PARAMETER_NAMES, "slope"];
/** @type {string[]} */
const OF_LOOPS = LAG_NAMES;
const ABOUT =
  "When another quantity reaches its limit. The limit is the clutch's own criterion for this quantity. If there is none, the " +
  "limit is the same share of the initial value as for mean COF; for a slope, the limit is 0 at 100 rpm.";
const ALL = "all";

/**
 * The levels that a quantity is tracked at, bar; none for those that have no pressure of their own.
 * @type {(name: string, answers: { tests: StribeckItem[], loops: LoopItem[] }) => number[]}
 */
export function levelsAt(name, { tests, loops }) {
  const first = tests.find(({ fits }) => fits.length > 0);
  if (OF_CURVES.includes(name)) {
    return distinct((first?.fits ?? []).map(({ pressure_bar: level }) => level));
  }
  return OF_LOOPS.includes(name) ? distinct(loops.map(({ pressure_bar: level }) => level)) : [];
}

/** @param {CriterionOutcome[]} criteria */
export function remainingTable(criteria) {
  const rows = criteria.map((criterion) => {
    const { remaining_cycles: left } = criterion;
    const remaining = left["0.5"] === null ? "–" : cycles(left["0.5"], left["0.05"], left["0.95"]);
    return [...criterionRow(criterion), remaining, interval(left)];
  });
  const columns = [...OWN_COLUMNS, "Remaining cycles", "90 % interval of them"];
  return scrolling(
    "Remaining life by a quantity",
    table("Remaining life by a quantity", columns, rows, { shown: true }),
  );
}

export class RemainingBy {
  /**
   * @param {HTMLElement} place
   * @param {string} clutchId
   */
  constructor(place, clutchId) {
    this.address = `${clutchPath(clutchId)}/remaining-useful-life`;
    this.controls = h("div", { class: "controls" });
    this.answer = h("div", { class: "answer", "aria-live": "polite" });
    this.details = h(
      "details",
      { class: "planned", ontoggle: () => this.ask() },
      h("summary", {}, "Remaining life by another quantity"),
      quiet(ABOUT),
      this.controls,
      this.answer,
    );
    place.append(this.details);
    /** @type {{ tests: StribeckItem[], loops: LoopItem[] }} */
    this.answers = { tests: [], loops: [] };
    this.readLoops = async () => /** @type {LoopItem[]} */ ([]);
    this.name = "static_torque_nm";
    /** @type {number | undefined} bar; undefined: over all pressures, or the usual one */
    this.level = undefined;
    this.request = "";
    this.revision = 0;
  }

  /** @param {{ life: RemainingLife, tests: StribeckItem[], loops: () => Promise<LoopItem[]> }} answers */
  show({ life, tests, loops }) {
    this.answers = { ...this.answers, tests };
    this.readLoops = loops;
    this.revision = life.revision;
    this.draw();
    this.ask();
  }

  draw() {
    const levels = levelsAt(this.name, this.answers);
    const whole = this.name === "mean_cof";
    const chosen = this.level !== undefined && levels.includes(this.level);
    if (!chosen) this.level = whole ? undefined : usual(levels);
    /** @type {[string, string][]} */
    const names = Object.entries(QUANTITIES).map(([name, { title }]) => [name, title]);
    const quantity = choice("Quantity", names, this.name, (name) => this.choose(name, this.level));
    /** @type {[string | number, string][]} */
    const options = whole ? [[ALL, "all pressures"], ...levelOptions(levels)] : levelOptions(levels);
    const pressure = choice("Pressure", options, this.level ?? ALL, (level) =>
      this.choose(this.name, typeof level === "number" ? level : undefined),
    );
    setControls(this, options.length > 0 ? [quantity, pressure] : [quantity]);
  }

  /** @type {(name: string, level: number | undefined) => void} `level`: bar */
  choose(name, level) {
    this.name = name;
    this.level = level;
    this.draw();
    this.ask();
  }

  /** The answer to what is chosen, where it is looked at and not there yet. */
  async ask() {
    if (this.details.open && OF_LOOPS.includes(this.name)) {
      this.answers.loops = await this.readLoops();
      this.draw();
    }
    const place = this.level === undefined ? "" : `&pressure_bar=${this.level}`;
    const query = `quantity=${this.name}${place}`;
    const wanted = `${this.revision} ${query}`;
    if (!this.details.open || wanted === this.request) return;
    this.request = wanted;
    this.answer.replaceChildren(quiet("Being computed …"));
    try {
      /** @type {{ body: RemainingLife }} */
      const { body } = await read(`${this.address}?${query}`);
      if (wanted === this.request) this.answer.replaceChildren(remainingTable(body.criteria));
    } catch (problem) {
      if (!(problem instanceof Problem)) throw problem;
      if (wanted !== this.request) return;
      this.request = ""; // it is asked for again when the clutch changes or another choice is made
      this.answer.replaceChildren(problemView(problem, "No prediction. "));
    }
  }
}
