// @ts-check
// Friction loops: by state at one pressure (figs. 12, 15), by pressure at one state (fig. 13), their area (figs. 14, 17).

import { fixed } from "../shared/format.js";
import { column, CYCLES, digitsColumn, distinct, PRESSURE } from "./columns.js";
import { eventMarks } from "./layout.js";
import { rampOf } from "./palette.js";
import { linesByPressure, titled } from "./traces.js";

/** @import { Channels, LoopItem, Receipt } from "../shared/types.js" */
/** @import { Spec } from "./types.js" */

/** Most points of a loop that are drawn. */
const MOST = 1500;
/** Bar about a level that still belong to it: on the way to the next one torque is of neither. */
const NEAR = 0.1;

const NO_LOOPS =
  "No dynamic Stribeck test yet. Send one as kind dynamic_stribeck: speed swept to and fro at constant pressure, sampled.";
const NO_PERIOD = "None of the records holds a whole closed period (eq. 8).";
const NO_AREA = "The area is known from the first dynamic Stribeck test on.";

/** @param {LoopItem[]} loops */
export const loopPressures = (loops) => distinct(loops.map((loop) => loop.pressure_bar));

/**
 * The record near a pressure, in its order, thinned evenly: speed and torque.
 * @param {Channels} channels
 * @param {number} pressure
 */
function traceOf({ pressure_bar: p, speed_rpm: n, torque_nm: m }, pressure) {
  /** @type {[number, number][]} */
  const points = [];
  for (let index = 0; index < n.length; index += 1) {
    if (Math.abs(p[index] - pressure) <= NEAR) points.push([n[index], m[index]]);
  }
  const step = Math.ceil(points.length / MOST);
  return step > 1 ? points.filter((_, index) => index % step === 0) : points;
}

/**
 * Torque over speed of some loops; `over` says whether the colour is the state or the pressure.
 * @param {object} choices
 * @param {LoopItem[]} choices.loops
 * @param {Record<string, Channels>} choices.channels by run
 * @param {"state" | "pressure"} choices.over
 * @param {number} choices.pressure where the colour is the state
 * @param {string | undefined} choices.run where the colour is the pressure
 * @returns {Spec}
 */
export function loopCurves({ loops, channels, over, pressure, run }) {
  const byState = over === "state";
  const drawn = loops
    .filter((loop) => channels[loop.run_id] && (byState ? loop.pressure_bar === pressure : loop.run_id === run))
    .map((loop) => ({ loop, trace: traceOf(channels[loop.run_id], loop.pressure_bar) }))
    .filter(({ trace }) => trace.length > 2);
  if (drawn.length === 0) return { empty: NO_LOOPS };
  /** @param {LoopItem} loop */
  const label = (loop) => (byState ? `${fixed(loop.cycles)} cycles` : `${fixed(loop.pressure_bar, 1)} bar`);
  return {
    note: byState
      ? `At ${fixed(pressure, 1)} bar, from the first dynamic test to the last.`
      : `After ${fixed(drawn[0].loop.cycles)} cycles, at every pressure.`,
    columns: [CYCLES, PRESSURE, column("speed, rpm", 1), column("torque, Nm", 2)],
    rows: drawn.flatMap(({ loop, trace }) =>
      trace.map(([speed, torque]) => [loop.cycles, loop.pressure_bar, speed, torque]),
    ),
    figure: (c) => ({
      data: drawn.map(({ loop, trace }, index) => ({
        name: label(loop),
        mode: "lines",
        x: trace.map(([speed]) => speed),
        y: trace.map(([, torque]) => torque),
        line: { color: rampOf(c, index, drawn.length), width: 1.3 },
        hovertemplate: `${label(loop)}<br>%{x:.0f} rpm, %{y:.2f} Nm<extra></extra>`,
      })),
      layout: { xaxis: titled("sliding speed, rpm"), yaxis: titled("friction torque, Nm") },
    }),
  };
}

const AREA_COLUMNS = [
  CYCLES,
  PRESSURE,
  digitsColumn("frequency, Hz", 3),
  digitsColumn("loop area, Nm·m/s", 3),
  digitsColumn("standard deviation", 2),
  digitsColumn("attractor, Nm·s", 3),
];

/**
 * The loops' area over cycles, a line a pressure.
 * @param {{ loops: LoopItem[], events: Receipt[] }} answers
 * @returns {Spec}
 */
export function loopAreas({ loops, events }) {
  const values = loops.flatMap((loop) => {
    const { cycles, pressure_bar: pressure, loop_area_nm_m_s: value, loop_area_sd_nm_m_s: sd } = loop;
    return value === null ? [] : [{ loop, cycles, pressure, value, sd }];
  });
  if (values.length === 0) return { empty: loops.length > 0 ? NO_PERIOD : NO_AREA };
  return {
    note: "Area of whole closed periods (eq. 8): positive where torque is higher in acceleration. 90 % error bars.",
    columns: AREA_COLUMNS,
    rows: values.map(({ loop, cycles, pressure, value, sd }) => {
      return [cycles, pressure, loop.frequency_hz, value, sd, loop.attractor_nm_s];
    }),
    figure: (c) => ({
      data: linesByPressure(
        distinct(values.map(({ pressure }) => pressure)),
        (level) => values.filter(({ pressure }) => pressure === level),
        { size: 7, bars: 3, text: "%{y:.3g} Nm·m/s" },
        c,
      ),
      layout: { xaxis: titled("duty cycles"), yaxis: titled("loop area, Nm·m/s"), ...eventMarks(events, c) },
    }),
  };
}
