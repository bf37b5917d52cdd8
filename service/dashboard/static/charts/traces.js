// The traces that several charts draw: bands between two edges, and points or lines with error bars.

import { pressureText } from "../shared/units.js";
import { distinct, HALF_OF_90 } from "./columns.js";
import { eventMarks } from "./layout.js";
import { faint, pressureRampOf } from "./palette.js";

/** @typedef {(number | null)[]} Values */
/** @typedef {{ x: Values, y: Values }} Places */

/** @type {(text: string) => { title: { text: string } }} the title of an axis */
export const titled = (text) => ({ title: { text } });

/** @typedef {string | Axis} Titled an axis, by its title where it has nothing else */

/** @param {Titled} axis */
const axisOf = (axis) => (typeof axis === "string" ? titled(axis) : axis);

/**
 * A figure over one pair of axes, with events marked.
 * @type {(x: Titled, y: Titled, events: Receipt[], traces: (c: Colours) => Trace[]) => (c: Colours) => Figure}
 */
export const planar = (x, y, events, traces) => (c) => ({
  data: traces(c),
  layout: { xaxis: axisOf(x), yaxis: axisOf(y), ...eventMarks(events, c) },
});

/** @type {(x: string, y: string, z: Titled, traces: (c: Colours) => Trace[]) => (c: Colours) => Figure} one in 3D */
export const solid = (x, y, z, traces) => (c) => ({
  data: traces(c),
  layout: { showlegend: false, scene: { xaxis: titled(x), yaxis: titled(y), zaxis: axisOf(z) } },
});

/**
 * A band between two edges, each with its own abscissae.
 * @param {string} name
 * @type {(name: string, lower: Places, upper: Places, c: Colours, color?: string) => PlainTrace[]}
 */
export function band(name, lower, upper, c, color = c.accent) {
  /** @type {Omit<PlainTrace, "x" | "y">} */
  const edge = { mode: "lines", line: { width: 0 }, hoverinfo: "skip", showlegend: false };
  const fillcolor = faint(color, 0.2);
  return [
    { ...edge, ...lower },
    { ...edge, ...upper, fill: "tonexty", fillcolor, name, showlegend: name !== "" },
  ];
}

/** @type {(name: string, at: Places, line: Line, text: string, more?: Partial<PlainTrace>) => PlainTrace} */
export const lineOf = (name, at, line, text, more = {}) => ({
  name,
  mode: "lines",
  ...at,
  line,
  hovertemplate: `${text}<extra></extra>`,
  ...more,
});

/**
 * A course and its 90 % band; `text` is shown under the pointer.
 * @param {{ cycles: number[], lower: number[], median: number[], upper: number[] }} course
 * @param {{ name: string, band?: string, line: Line, text: string }} look
 * @param {Colours} c
 */
export function tracked({ cycles: x, lower, median, upper }, { name, band: edges = "90 % band", line, text }, c) {
  return [
    ...band(edges, { x, y: lower }, { x, y: upper }, c, line.color),
    lineOf(name, { x, y: median }, line, text, { showlegend: x.length > 0 }),
  ];
}

/** @typedef {{ color: string, text: string, size?: number, thickness?: number, bars?: number }} PointLook `text`: under the pointer */

/**
 * Points with bars that span the 90 % interval, over cycles or what stands in their place; a deviation that is null has none.
 * @type {(name: string, measured: { cycles: number[], value: number[], sd: (number | null)[] }, look: PointLook) => PlainTrace}
 */
export const measuredPoints = (name, measured, { color, text, size = 6, thickness = 1.1, bars = 3 }) => ({
  name,
  mode: "markers",
  x: measured.cycles,
  y: measured.value,
  marker: { color, size },
  error_y: { type: "data", array: measured.sd.map((sd) => HALF_OF_90 * (sd ?? 0)), color, thickness, width: bars },
  hovertemplate: `${text}<extra></extra>`,
});

/** @typedef {{ x: Values, y: Values, z: Values | Values[] }} Spatial */

/** @type {(at: Spatial, colorscale: [number, string][], text: string, opacity?: number) => Trace} a surface in 3D */
export const surfaceOf = (at, colorscale, text, opacity = 0.86) => ({
  type: "surface",
  ...at,
  colorscale,
  opacity,
  showscale: false,
  hovertemplate: `${text}<extra></extra>`,
});

/** @type {(at: Spatial, size: number, color: string, text: string) => Trace} points in 3D */
export const spatialPoints = (at, size, color, text) => ({
  type: "scatter3d",
  mode: "markers",
  ...at,
  marker: { size, color },
  hovertemplate: `${text}<extra></extra>`,
});

/** @typedef {{ size: number, bars: number, text: string }} Look `text`: under the pointer */

/**
 * A line with points and error bars.
 * @type {(name: string, values: { x: number, value: number, sd: number | null }[], look: Look, color: string) => PlainTrace}
 */
export function measuredLine(name, values, look, color) {
  const [cycles, value] = [values.map(({ x }) => x), values.map((each) => each.value)];
  const measured = { cycles, value, sd: values.map(({ sd }) => sd) };
  const points = measuredPoints(name, measured, { color, thickness: 1, ...look });
  return { ...points, mode: "lines+markers", line: { color, width: 1.4 } };
}

/**
 * A line with points and error bars for each pressure, over cycles.
 * @param {{ cycles: number, pressure: number, value: number, sd: number | null }[]} values
 * @param {Look} look
 * @param {Colours} c
 */
export function linesByPressure(values, { text, ...look }, c) {
  const pressures = distinct(values.map(({ pressure }) => pressure));
  return pressures.map((level, index) => {
    const own = values.filter(({ pressure }) => pressure === level);
    const points = own.map(({ cycles, value, sd }) => ({ x: cycles, value, sd }));
    const name = pressureText(level);
    const under = `%{x:,.0f} cycles, ${name}<br>${text}`;
    return measuredLine(name, points, { ...look, text: under }, pressureRampOf(c, index, pressures.length));
  });
}
