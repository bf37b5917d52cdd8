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

/** The torque or the coefficient that is shown, in its unit. */
export const torqueColumn = () => column(named(units().torque), units().torque.decimals);

export const CYCLES = column("cycles");
export const PRESSURE = column("pressure, bar", 1);

/**
 * Measured values and eq. 6 as rows: kind, what `before` holds, cycles, value and its 90 % interval.
 * @param {{ measured: Measured, trajectory: Trajectory }} item
 * @param {{ measured: string, law: string, before?: Cell[] }} kinds
 * @returns {Cell[][]}
 */
export function measuredAndLaw({ measured, trajectory }, { measured: kind, law, before = [] }) {
  const points = measured.cycles.map((at, index) => {
    const [value, half] = [measured.value[index], HALF_OF_90 * measured.sd[index]];
    return [kind, ...before, at, value, value - half, value + half];
  });
  const { median, lower, upper } = trajectory;
  const line = trajectory.cycles.map((at, index) => [law, ...before, at, median[index], lower[index], upper[index]]);
  return [...points, ...line];
}

/** @type {(values: number[]) => number[]} values in ascending order, each once */
export const distinct = (values) => [...new Set(values)].sort((a, b) => a - b);
