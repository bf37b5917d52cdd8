// @ts-check
// The quantities that are tracked along a life and may end it: title and unit by public name.

import { PARAMETERS } from "../charts/parameters.js";

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
