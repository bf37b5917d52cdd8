// @ts-check
// The choices above charts: their options, what is chosen at first, and how they are put in place.

import { distinct } from "../charts/columns.js";
import { fixed } from "../shared/format.js";
import { pressureText } from "../shared/units.js";

/** @import { DegradationItem } from "../shared/types.js" */

/** The pressure that is shown first is the one closest to this, bar. */
const USUAL_PRESSURE = 5;

/**
 * The chosen level, or the one closest to the usual; undefined where there are none.
 * @param {number[]} levels bar
 * @param {number} [chosen] bar
 */
export function usual(levels, chosen) {
  if (chosen !== undefined && levels.includes(chosen)) return chosen;
  /** @param {number} level */
  const distance = (level) => Math.abs(level - USUAL_PRESSURE);
  return levels.length === 0 ? undefined : levels.reduce((a, b) => (distance(b) < distance(a) ? b : a));
}

/** @type {(items: DegradationItem[]) => number[]} the pressures that quantities are tracked at, bar */
export const levelsOf = (items) =>
  distinct(items.flatMap(({ pressure_bar: level }) => (level === null ? [] : [level])));

/** @type {(levels: number[]) => [number, string][]} */
export const levelOptions = (levels) => levels.map((level) => [level, pressureText(level)]);

/** @type {(tests: { run_id: string, cycles: number }[]) => [string, string][]} */
export const stateOptions = (tests) => tests.map((test) => [test.run_id, `${fixed(test.cycles)} cycles`]);
