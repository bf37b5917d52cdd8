// The curves that several charts draw: bands between two edges, points or lines with error bars, and events as marks.

import { pressureText } from "../shared/units.js";
import { distinct, HALF_OF_90 } from "./columns.js";
import { faint, pressureRampOf } from "./palette.js";

/** @typedef {string | Axis} Titled an axis, by its title where it has nothing else */

/** @type {(axis: Titled) => Axis} */
const axisOf = (axis) => (typeof axis === "string" ? { title: axis } : axis);

/**
 * A figure over one pair of axes, with events marked.
 * @type {(x: Titled, y: Titled, events: Receipt[], curves: (c: Colours) => Curve[]) => (c: Colours) => Figure}
 */
export const planar = (x, y, events, curves) => (c) => [
  { x: axisOf(x), y: axisOf(y), curves: curves(c), marks: eventMarks(events, c) },
];

/** @type {(events: Receipt[], c: Colours) => Mark[]} lines with names */
export const eventMarks = (events, c) =>
  events.map(({ cycles: x, event, note }) => {
    const text = event === "other" && note ? plainNote(note) : (event ?? "").replaceAll("_", " ");
    return { x, line: { color: c.maintenance, width: 1.5, dash: "dot" }, text, turned: true };
  });

/** @param {string} note in which nothing may look like the drawing's small markup */
const plainNote = (note) => note.replaceAll("<", "‹").replaceAll(">", "›").slice(0, 40);

/** @type {(name: string, lower: Places, upper: Places, c: Colours, color?: string) => Curve} between two edges */
export const band = (name, lower, upper, c, color = c.accent) => ({ ...upper, name, lower, fill: faint(color, 0.2) });

/**
 * A course and its 90 % band.
 * @param {{ cycles: number[], lower: number[], median: number[], upper: number[] }} course
 * @param {{ name: string, band?: string, line: Line }} look
 * @param {Colours} c
 * @returns {Curve[]}
 */
export function tracked({ cycles: x, lower, median, upper }, { name, band: edges = "90 % band", line }, c) {
  if (x.length === 0) return [];
  return [band(edges, { x, y: lower }, { x, y: upper }, c, line.color), { name, x, y: median, line }];
}

/**
 * Points with bars that span the 90 % interval, over cycles or what stands in their place; a deviation that is null has none.
 * @type {(name: string, measured: { cycles: number[], value: number[], sd: (number | null)[] }, marker: Marker) => Curve}
 */
export const measuredPoints = (name, { cycles, value, sd }, marker) => ({
  name,
  x: cycles,
  y: value,
  marker,
  half: sd.map((each) => HALF_OF_90 * (each ?? 0)),
});

/**
 * A line with points and error bars.
 * @type {(name: string, values: { x: number, value: number, sd: number | null }[], marker: Marker) => Curve}
 */
export function measuredLine(name, values, marker) {
  const measured = {
    cycles: values.map(({ x }) => x),
    value: values.map(({ value }) => value),
    sd: values.map(({ sd }) => sd),
  };
  return { ...measuredPoints(name, measured, marker), line: { color: marker.color, width: 1.4 } };
}

/**
 * A line with points and error bars for each pressure, over cycles.
 * @param {{ cycles: number, pressure: number, value: number, sd: number | null }[]} values
 * @param {number} size of points, px
 * @param {Colours} c
 */
export function linesByPressure(values, size, c) {
  const pressures = distinct(values.map(({ pressure }) => pressure));
  return pressures.map((level, index) => {
    const own = values.filter(({ pressure }) => pressure === level);
    const points = own.map(({ cycles, value, sd }) => ({ x: cycles, value, sd }));
    return measuredLine(pressureText(level), points, { size, color: pressureRampOf(c, index, pressures.length) });
  });
}
