// The quantities that are tracked along a life and may end it, and what is chosen of them above charts.

import { distinct } from "../charts/columns.js";
import { PARAMETERS } from "../charts/parameters.js";
import { fixed } from "../shared/format.js";
import { pressureText } from "../shared/units.js";

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

/** The indicators of an engagement by name: what it is, and its unit. */
export const INDICATORS = {
  stop_time_s: ["Stop time", "s"],
  midpoint_cof: ["Midpoint COF", ""],
  initial_cof: ["Initial COF", ""],
  endpoint_cof: ["Endpoint COF", ""],
  breakaway_cof: ["Breakaway COF", ""],
  initial_cof_ratio: ["Initial COF / midpoint COF", ""],
  endpoint_cof_ratio: ["Endpoint COF / midpoint COF", ""],
  breakaway_cof_ratio: ["Breakaway COF / midpoint COF", ""],
  torque_rise: ["Rise of torque at the end", ""],
  engagement_energy_kj: ["Energy", "kJ"],
  peak_power_kw: ["Peak power", "kW"],
  normalised_duration: ["Duration relative to the first engagement", ""],
  euclidean_distance: ["Distance of speed from the first engagement", ""],
  spectral_angle_rad: ["Spectral angle to the first engagement", "rad"],
};

/** @type {Record<string, { title: string, unit: string }>} */
export const QUANTITIES = {
  mean_cof: { title: "Mean COF", unit: "" },
  ...PARAMETERS,
  viscous_coefficient: { title: "Viscous coefficient", unit: "Nm/(m/s)⁰·³" },
  slope: { title: "Slope dμ/dv", unit: "s/m" },
  attractor: { title: "Attractor C", unit: "Nm/s" },
  film_time: { title: "Film time", unit: "s" },
  loop_area: { title: "Loop area", unit: "Nm·m/s" },
  ...Object.fromEntries(Object.entries(INDICATORS).map(([name, [title, unit]]) => [name, { title, unit }])),
};
