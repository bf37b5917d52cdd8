// The four Stribeck parameters over cycles: eq. 6 with its band at one pressure (fig. 10), and over all of them (fig. 11).

import { estimate } from "../shared/format.js";
import { CYCLES, intervalColumns, KIND, measuredAndTracked, PRESSURE } from "./columns.js";
import { between, contoured, cutsOf } from "./contours.js";
import { measuredPoints, planar, tracked } from "./traces.js";

/** @typedef {"static_torque_nm" | "coulomb_ratio" | "stribeck_velocity_m_s" | "viscous_coefficient"} ParameterName */

/** @type {Record<ParameterName, { title: string, symbol: [string, string], unit: string }>} */
export const PARAMETERS = {
  static_torque_nm: { title: "Static torque", symbol: ["M", "s"], unit: "Nm" },
  coulomb_ratio: { title: "Coulomb ratio", symbol: ["M̄", "c"], unit: "" },
  stribeck_velocity_m_s: { title: "Stribeck velocity", symbol: ["V", "S"], unit: "m/s" },
  viscous_coefficient: { title: "Viscous coefficient", symbol: ["C", "v"], unit: "Nm/(m/s)^0.3" },
};

export const PARAMETER_NAMES = /** @type {ParameterName[]} */ (Object.keys(PARAMETERS));

/** @type {(name: ParameterName) => string} a parameter's axis, in the drawing's small markup */
export function axisOf(name) {
  const { symbol, unit } = PARAMETERS[name];
  return `${symbol[0]}<sub>${symbol[1]}</sub>${unit && `, ${unit.replace(/\^([\d.]+)/, "<sup>$1</sup>")}`}`;
}

const COLUMNS = [KIND, PRESSURE, CYCLES, ...intervalColumns("value", 4)];

/**
 * A range that the measurements set, not an error bar that leaves the paper.
 * @type {(item: DegradationItem) => Span}
 */
function rangeOf({ measured, trajectory }) {
  const all = [...measured.value, ...trajectory.median].sort((a, b) => a - b);
  const [low, high] = [all[Math.floor(0.01 * all.length)], all[Math.ceil(0.99 * all.length) - 1]];
  const room = 0.35 * (high - low) || 0.1 * Math.abs(high) || 1;
  return [Math.min(low - room, low >= 0 && low < room ? 0 : low - room), high + room];
}

/**
 * One parameter at one pressure.
 * @param {{ items: DegradationItem[], name: ParameterName, pressure: number | undefined, events: Receipt[] }} answers
 * @returns {Spec}
 */
export function parameter({ items, name, pressure, events }) {
  const item = items.find(({ quantity, pressure_bar: level }) => quantity === name && level === pressure);
  if (!item?.coefficients) return { empty: "Tracking needs three tests at different cycles at this pressure." };
  const { measured, trajectory, coefficients: k } = item;
  const { unit } = PARAMETERS[name];
  const inUnit = unit && ` ${unit.replace("^0.3", "⁰·³")}`;
  const [initial, change] = [k.initial, k.change].map(({ value, sd }) => inWords(value, sd, inUnit));
  const scale = inWords(k.scale_cycles.value, k.scale_cycles.sd, " cycles");
  return {
    note: `Value when new ${initial}, total change ${change}, scale ${scale}.`,
    columns: COLUMNS,
    rows: measuredAndTracked(item, "identified", pressure),
    figure: planar("duty cycles", { title: axisOf(name), range: rangeOf(item) }, events, (c) => [
      ...tracked(trajectory, { name: "tracked", line: { color: c.accent, width: 2 } }, c),
      measuredPoints("identified", measured, { color: c.ink }),
    ]),
  };
}

/** @type {(value: number, sd: number, unit: string) => string} a coefficient with its unit, where it is known */
function inWords(value, sd, unit) {
  const text = estimate(value, sd);
  return text === "unknown" ? text : `${text}${unit}`;
}

/**
 * One parameter over cycles and pressure: isolines of the law, and a cut beside what was identified.
 * @type {(answers: { items: DegradationItem[], name: ParameterName, cut: string | undefined }) => Spec}
 */
export function landscape({ items, name, cut }) {
  const own = items
    .flatMap((item) =>
      item.quantity === name && item.pressure_bar !== null ? [{ item, pressure: item.pressure_bar }] : [],
    )
    .sort((a, b) => a.pressure - b.pressure);
  if (own.length < 2) return { empty: "A surface needs two pressures or more." };
  // every pressure's law on the same cycles, those of the longest
  const laws = own.map(({ item }) => item.trajectory);
  const end = (/** @type {Trajectory} */ each) => each.cycles.at(-1) ?? 0;
  const x = laws.reduce((a, b) => (end(b) > end(a) ? b : a)).cycles;
  const tracking = {
    name: "tracked",
    points: "identified",
    x,
    y: own.map(({ pressure }) => pressure),
    values: laws.map(({ cycles, median }) => x.map((at) => between(cycles, median, at))),
    measured: own.flatMap(({ item: { measured }, pressure }) =>
      measured.cycles.map((at, index) => ({ x: at, y: pressure, z: measured.value[index] })),
    ),
  };
  const titles = { x: "duty cycles", y: "pressure, bar", z: { title: axisOf(name) } };
  const cuts = cutsOf([tracking], titles, cut);
  return {
    note: `${PARAMETERS[name].title} at every pressure, tracked over life: lines of equal value, and along the dashed cut. Points: identified from one test each.`,
    columns: COLUMNS,
    rows: own.flatMap(({ item, pressure }) => measuredAndTracked(item, "identified", pressure)),
    cuts,
    figure: (c) => contoured([tracking], titles, cuts, c),
  };
}
