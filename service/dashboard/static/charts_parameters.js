// The four Stribeck parameters over cycles: eq. 6 with its band at one pressure (fig. 10), and over all of them (fig. 11).

import { fixed, significant, withSd } from "./format.js";
import { eventMarks } from "./layout.js";
import { faint, scaleOf } from "./palette.js";

export const PARAMETERS = {
  static_torque_nm: { title: "Static torque", symbol: ["M", "s"], unit: "Nm" },
  coulomb_ratio: { title: "Coulomb ratio", symbol: ["M̄", "c"], unit: "" },
  stribeck_velocity_m_s: { title: "Stribeck velocity", symbol: ["V", "S"], unit: "m/s" },
  viscous_coefficient: { title: "Viscous coefficient", symbol: ["C", "v"], unit: "Nm/(m/s)^0.3" },
};

/** A parameter's axis, in the plotting library's own small markup. */
function axisOf(name) {
  const { symbol: [letter, index], unit } = PARAMETERS[name];
  return `${letter}<sub>${index}</sub>${unit && `, ${unit.replace(/\^([\d.]+)/, "<sup>$1</sup>")}`}`;
}

const COLUMNS = [
  { name: "kind" }, { name: "pressure, bar", text: (value) => fixed(value, 1) }, { name: "cycles", text: (value) => fixed(value) },
  { name: "value", text: (value) => significant(value, 4) }, { name: "lower, 5 %", text: (value) => significant(value, 4) }, { name: "upper, 95 %", text: (value) => significant(value, 4) }];

const rowsOf = ({ pressure_bar: pressure, measured, trajectory }) => [
  ...measured.cycles.map((at, index) => ["identified", pressure, at, measured.value[index], measured.value[index] - 1.645 * measured.sd[index], measured.value[index] + 1.645 * measured.sd[index]]),
  ...trajectory.cycles.map((at, index) => ["law", pressure, at, trajectory.median[index], trajectory.lower[index], trajectory.upper[index]])];

/** A range that the measurements set, not an error bar that leaves the paper. */
function rangeOf({ measured, trajectory }) {
  const all = [...measured.value, ...trajectory.median].sort((a, b) => a - b);
  const [low, high] = [all[Math.floor(0.01 * all.length)], all[Math.ceil(0.99 * all.length) - 1]];
  const room = 0.35 * (high - low) || 0.1 * Math.abs(high) || 1;
  return [Math.min(low - room, low >= 0 && low < room ? 0 : low - room), high + room];
}

/** One parameter at one pressure. */
export function parameter({ items, name, pressure, events }) {
  const item = items.find((each) => each.quantity === name && each.pressure_bar === pressure);
  if (!item) return { empty: "The tests at this pressure do not determine it." };
  const { measured, trajectory, coefficients: k } = item;
  const { unit } = PARAMETERS[name];
  const inUnit = unit && ` ${unit.replace("^0.3", "⁰·³")}`;
  return {
    note: `Eq. 6: ${withSd(k.initial.value, k.initial.sd)}${inUnit} when new, a change of ${withSd(k.change.value, k.change.sd)}${inUnit} in the end, on a scale of ${significant(k.scale_cycles.value, 2)} cycles.`,
    columns: COLUMNS, rows: rowsOf(item),
    figure: (c) => {
      const edge = { mode: "lines", x: trajectory.cycles, line: { width: 0 }, hoverinfo: "skip", showlegend: false };
      return {
        data: [
          { ...edge, y: trajectory.lower },
          { ...edge, y: trajectory.upper, fill: "tonexty", fillcolor: faint(c.accent, 0.2), name: "90 % band", showlegend: true },
          { name: "eq. 6", mode: "lines", x: trajectory.cycles, y: trajectory.median, line: { color: c.accent, width: 2 }, hovertemplate: "%{x:,.0f} cycles<br>eq. 6: %{y:.4g}<extra></extra>" },
          { name: "identified", mode: "markers", x: measured.cycles, y: measured.value, marker: { color: c.ink, size: 6 }, error_y: { type: "data", array: measured.sd.map((sd) => 1.645 * sd), color: c.ink, thickness: 1.1, width: 3 }, hovertemplate: "%{x:,.0f} cycles<br>%{y:.4g}<extra></extra>" }],
        layout: { xaxis: { title: { text: "duty cycles" } }, yaxis: { title: { text: axisOf(name) }, range: rangeOf(item) }, ...eventMarks(events, c) },
      };
    },
  };
}

/** One parameter over cycles and pressure: the law as a surface, what was identified as points. */
export function landscape({ items, name }) {
  const own = items.filter((each) => each.quantity === name && each.pressure_bar !== null).sort((a, b) => a.pressure_bar - b.pressure_bar);
  if (own.length < 2) return { empty: "A surface needs two pressures or more." };
  const [low, high] = own.map(rangeOf).reduce(([a, b], [x, y]) => [Math.min(a, x), Math.max(b, y)]);
  const inside = (value) => value >= low && value <= high;
  const points = own.flatMap(({ pressure_bar: pressure, measured }) => measured.cycles.map((at, index) => [at, pressure, measured.value[index]])).filter((point) => inside(point[2]));
  // every pressure's law on the same cycles, those of the longest
  const longest = own.reduce((a, b) => (b.trajectory.cycles.at(-1) > a.trajectory.cycles.at(-1) ? b : a)).trajectory.cycles;
  return {
    note: `${PARAMETERS[name].title} at every pressure: points identified, surface eq. 6. Drag to turn.`,
    columns: COLUMNS, rows: own.flatMap(rowsOf),
    figure: (c) => ({
      data: [
        { type: "surface", x: longest, y: own.map((each) => each.pressure_bar), z: own.map((each) => longest.map((at) => at_(each.trajectory, at))), colorscale: scaleOf(c), opacity: 0.86, showscale: false, hovertemplate: "%{x:,.0f} cycles, %{y} bar<br>eq. 6: %{z:.4g}<extra></extra>" },
        { type: "scatter3d", mode: "markers", x: points.map((p) => p[0]), y: points.map((p) => p[1]), z: points.map((p) => p[2]), marker: { size: 2.6, color: c.ink }, hovertemplate: "%{x:,.0f} cycles, %{y} bar<br>%{z:.4g}<extra></extra>" }],
      layout: { showlegend: false, scene: { xaxis: { title: { text: "duty cycles" } }, yaxis: { title: { text: "pressure, bar" } }, zaxis: { title: { text: axisOf(name) }, range: [low, high] } } },
    }),
  };
}

/** The law's median between its points; null past its end. */
function at_({ cycles, median }, at) {
  const index = cycles.findIndex((each) => each >= at);
  if (index < 0) return null;
  if (index === 0) return median[0];
  const share = (at - cycles[index - 1]) / (cycles[index] - cycles[index - 1]);
  return median[index - 1] + share * (median[index] - median[index - 1]);
}
