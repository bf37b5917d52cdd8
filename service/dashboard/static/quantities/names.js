// The quantities that are tracked along a life and may end it, and what is chosen of them above charts.

import { PARAMETERS } from "../charts/parameters.js";
import { offered } from "../shared/dom.js";
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

/** @type {(levels: number[]) => [number, string][]} */
export const levelOptions = (levels) => offered(levels, pressureText);

/**
 * The one of that run, or the first; undefined where there are none.
 * @template {{ run_id: string }} Item
 * @param {Item[]} items
 * @param {string | undefined} run
 * @returns {Item | undefined}
 */
export const ofRun = (items, run) => items.find(({ run_id: id }) => id === run) ?? items[0];

/** @type {(tests: { run_id: string, cycles: number }[]) => [string, string][]} */
export const stateOptions = (tests) => tests.map((test) => [test.run_id, `${fixed(test.cycles)} cycles`]);

/** @typedef {{ title: string, unit: string }} Titled what a quantity is, and its unit */

/** The indicators of an engagement by name. */
export const INDICATORS = {
  stop_time_s: { title: "Stop time", unit: "s" },
  midpoint_cof: { title: "Midpoint COF", unit: "" },
  initial_cof: { title: "Initial COF", unit: "" },
  endpoint_cof: { title: "Endpoint COF", unit: "" },
  breakaway_cof: { title: "Breakaway COF", unit: "" },
  initial_cof_ratio: { title: "Initial COF / midpoint COF", unit: "" },
  endpoint_cof_ratio: { title: "Endpoint COF / midpoint COF", unit: "" },
  breakaway_cof_ratio: { title: "Breakaway COF / midpoint COF", unit: "" },
  torque_rise: { title: "Rise of torque at the end", unit: "" },
  engagement_energy_kj: { title: "Energy", unit: "kJ" },
  peak_power_kw: { title: "Peak power", unit: "kW" },
  normalised_duration: { title: "Duration relative to the first engagement", unit: "" },
  euclidean_distance: { title: "Distance of speed from the first engagement", unit: "" },
  spectral_angle_rad: { title: "Spectral angle to the first engagement", unit: "rad" },
};

/** @type {Record<string, Titled>} */
export const QUANTITIES = {
  mean_cof: { title: "Mean COF", unit: "" },
  ...PARAMETERS,
  viscous_coefficient: { title: "Viscous coefficient", unit: "Nm/(m/s)⁰·³" },
  slope: { title: "Slope dμ/dv", unit: "s/m" },
  attractor: { title: "Attractor C", unit: "Nm/s" },
  film_time: { title: "Film time", unit: "s" },
  loop_area: { title: "Loop area", unit: "Nm·m/s" },
  ...INDICATORS,
};

/** @type {(quantity: Titled) => string} */
export const titleOf = ({ title, unit }) => (unit === "" ? title : `${title}, ${unit}`);

/**
 * What is chosen of several quantities, each with its title.
 * @template {string} Name
 * @param {Record<Name, { title: string }>} quantities
 * @param {Name[]} names
 */
export const optionsOf = (quantities, names = /** @type {Name[]} */ (Object.keys(quantities))) =>
  offered(names, (name) => quantities[name].title);
