// @ts-check
// The quantities that are tracked along a life and may end it: title and unit by public name.

import { INDICATORS } from "../engagements/charts.js";

/** @type {Record<string, { title: string, unit: string }>} */
export const QUANTITIES = {
  mean_cof: { title: "Mean COF", unit: "" },
  static_torque_nm: { title: "Static torque", unit: "Nm" },
  coulomb_ratio: { title: "Coulomb ratio", unit: "" },
  stribeck_velocity_m_s: { title: "Stribeck velocity", unit: "m/s" },
  viscous_coefficient: { title: "Viscous coefficient", unit: "Nm/(m/s)⁰·³" },
  slope: { title: "Slope dμ/dv", unit: "s/m" },
  attractor: { title: "Attractor C", unit: "Nm/s" },
  film_time: { title: "Film time", unit: "s" },
  loop_area: { title: "Loop area", unit: "Nm·m/s" },
  ...Object.fromEntries(Object.entries(INDICATORS).map(([name, [title, unit]]) => [name, { title, unit }])),
};
