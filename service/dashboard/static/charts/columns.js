// The columns that the charts' tables share, and the rows of a quantity that is measured and follows eq. 6.

import { fixed, significant } from "../shared/format.js";
import { named, units } from "../shared/units.js";

/** Half of a 90 % interval in standard deviations. */
export const HALF_OF_90 = 1.645;

/** @type {Column} */
export const KIND = { name: "kind" };

/** @type {(name: string, decimals?: number) => Column} a column with that many decimals */
export const column = (name, decimals = 0) => ({ name, text: (value) => fixed(value, decimals) });

/** @type {(name: string, digits: number) => Column} a column with that many significant digits */
export const digitsColumn = (name, digits) => ({ name, text: (value) => significant(value, digits) });

/** @type {(name: string, digits: number) => Column[]} a quantity and its 90 % interval, with that many significant digits */
export const intervalColumns = (name, digits) =>
  [name, "lower, 5 %", "upper, 95 %"].map((each) => digitsColumn(each, digits));

export const CYCLES = column("cycles");
export const PRESSURE = column("pressure, bar", 1);

/** Of torque, or the coefficient that is shown for it, over speed. */
export const recordColumns = () => [
  KIND,
  CYCLES,
  PRESSURE,
  column("speed, rpm", 1),
  column(named(units().torque), units().torque.decimals),
];

/** @type {(value: number, sd: number) => number[]} with its 90 % interval */
export const withInterval = (value, sd) => [value, value - HALF_OF_90 * sd, value + HALF_OF_90 * sd];

/**
 * Measured values and the tracked course as rows: kind, what `before` holds, cycles, value and its 90 % interval.
 * @param {{ measured: Measured, trajectory: Trajectory }} item
 * @param {"measured" | "identified"} kind of the values
 * @param {Cell[]} before
 * @returns {Cell[][]}
 */
export function measuredAndTracked({ measured: { cycles, value, sd }, trajectory }, kind, ...before) {
  const { cycles: x, median, lower, upper } = trajectory;
  return [
    ...cycles.map((at, index) => [kind, ...before, at, ...withInterval(value[index], sd[index])]),
    ...x.map((at, index) => ["tracked", ...before, at, median[index], lower[index], upper[index]]),
  ];
}

/** @type {(items: { pressure_bar: number | null }[]) => number[]} the pressures that there are, bar */
export const levelsOf = (items) => distinct(items.flatMap(({ pressure_bar: level }) => level ?? []));

/** @type {(values: number[]) => number[]} values in ascending order, each once */
export const distinct = (values) => [...new Set(values)].sort((a, b) => a - b);
