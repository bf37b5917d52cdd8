// @ts-check
// Stribeck curves: at one pressure by state (fig. 7), and as surfaces over pressure (figs. 6, 8) or over cycles (fig. 7).

import { fixed } from "../shared/format.js";
import { column, CYCLES, distinct, KIND } from "./columns.js";
import { faint, rampOf, scaleOf } from "./palette.js";
import { curveOf, measuredOf } from "./stribeck_law.js";
import { titled } from "./traces.js";

/** @import { Channels, ClutchOut, StribeckItem } from "../shared/types.js" */
/** @import { CurvePoint } from "./stribeck_law.js" */
/** @import { Cell, Colours, PlainTrace, Spec, Trace } from "./types.js" */

/**
 * @typedef {object} Answers
 * @property {StribeckItem[]} tests
 * @property {Record<string, Channels>} channels by run; of the tests that are drawn
 * @property {ClutchOut} clutch
 * @property {number | undefined} pressure bar
 */
/** @typedef {{ cycles: number, pressure: number, measured: CurvePoint[], fitted: CurvePoint[] }} Drawn */

const COLUMNS = [KIND, CYCLES, column("pressure, bar", 2), column("speed, rpm"), column("torque, Nm", 2)];

/**
 * A few items spread evenly over all, the first and the last among them.
 * @template Item
 * @param {Item[]} items
 * @param {number} [most]
 */
export function spread(items, most = 6) {
  if (items.length <= most) return items;
  return Array.from({ length: most }, (_, index) => items[Math.round((index * (items.length - 1)) / (most - 1))]);
}

/** @param {StribeckItem[]} tests */
export const pressuresOf = (tests) => distinct(tests.flatMap((test) => test.fits.map((fit) => fit.pressure_bar)));

/**
 * The highest speed of the drawn records, rpm, and no less than 100.
 * @param {Record<string, Channels>} channels
 */
const fastest = (channels) =>
  Object.values(channels).reduce((most, { speed_rpm: speeds }) => speeds.reduce((a, b) => Math.max(a, b), most), 100);

/**
 * Some tests at some pressures: measured points where the channels have been read, the fit in any case.
 * @param {Answers} answers
 * @param {StribeckItem[]} tests
 * @param {(pressure: number) => boolean} wanted
 * @returns {Drawn[]}
 */
function drawnOf({ channels, clutch }, tests, wanted) {
  const end = fastest(channels);
  return tests.flatMap((test) =>
    test.fits
      .filter((fit) => wanted(fit.pressure_bar))
      .map((fit) => ({
        cycles: test.cycles,
        pressure: fit.pressure_bar,
        measured: channels[test.run_id] ? measuredOf(channels[test.run_id], fit.pressure_bar) : [],
        fitted: curveOf(fit, clutch, 0, end),
      })),
  );
}

/**
 * @param {Drawn[]} drawn
 * @returns {Cell[][]}
 */
const rowsOf = (drawn) =>
  drawn.flatMap(({ cycles, pressure, measured, fitted }) => [
    ...measured.map((point) => ["measured", cycles, pressure, point.speed, point.torque]),
    ...fitted.map((point) => ["fit", cycles, pressure, point.speed, point.torque]),
  ]);

/** @param {CurvePoint[]} points */
const speeds = (points) => points.map(({ speed }) => speed);
/** @param {CurvePoint[]} points */
const torques = (points) => points.map(({ torque }) => torque);

/**
 * Torque over speed at one pressure, a colour a state.
 * @param {Answers} answers
 * @returns {Spec}
 */
export function flat(answers) {
  const { tests, pressure } = answers;
  const drawn = drawnOf(answers, spread(tests), (level) => level === pressure);
  if (drawn.length === 0) return { empty: "No stationary Stribeck test yet at this pressure." };
  return {
    note: `At ${fixed(pressure, 1)} bar: points measured, lines fitted (eq. 3), from the first test to the last.`,
    columns: COLUMNS,
    rows: rowsOf(drawn),
    figure: (c) => ({
      data: drawn.flatMap((state, index) => flatTraces(state, rampOf(c, index, drawn.length), c)),
      layout: { xaxis: { ...titled("sliding speed, rpm"), rangemode: "tozero" }, yaxis: titled("friction torque, Nm") },
    }),
  };
}

/**
 * @param {Drawn} state
 * @param {string} color
 * @param {Colours} c
 * @returns {PlainTrace[]}
 */
function flatTraces({ cycles, measured, fitted }, color, c) {
  const name = `${fixed(cycles)} cycles`;
  const hovertemplate = `${name}<br>%{x:.0f} rpm, %{y:.2f} Nm<extra></extra>`;
  const shared = { legendgroup: name, name, hovertemplate };
  const marker = { color: faint(c.panel, 1), size: 5, line: { color, width: 1.4 } };
  return [
    { ...shared, mode: "lines", x: speeds(fitted), y: torques(fitted), line: { color, width: 2 } },
    { ...shared, showlegend: false, mode: "markers", x: speeds(measured), y: torques(measured), marker },
  ];
}

/**
 * The surface of one state over speed and pressure (figs. 6, 8), or of one pressure over speed and cycles (fig. 7).
 * @param {Answers & { over: "pressure" | "cycles", run: string | undefined }} answers `run`: the state
 * @returns {Spec}
 */
export function surface(answers) {
  const { tests, over, pressure, run } = answers;
  const byPressure = over === "pressure";
  const chosen = byPressure ? tests.filter((test) => test.run_id === run) : spread(tests, 9);
  const drawn = drawnOf(answers, chosen, (level) => byPressure || level === pressure);
  if (drawn.length < 2) {
    return { empty: `A surface needs ${byPressure ? "a test at two pressures" : "two tests"} or more.` };
  }
  const place = byPressure ? `After ${fixed(drawn[0].cycles)} cycles` : `At ${fixed(pressure, 1)} bar over the life`;
  return {
    note: `${place}: points measured, surface fitted. Drag to turn.`,
    columns: COLUMNS,
    rows: rowsOf(drawn),
    figure: (c) => ({
      data: surfaceTraces(drawn, byPressure, c),
      layout: {
        showlegend: false,
        scene: {
          xaxis: titled("speed, rpm"),
          yaxis: titled(byPressure ? "pressure, bar" : "duty cycles"),
          zaxis: titled("torque, Nm"),
        },
      },
    }),
  };
}

/**
 * @param {Drawn[]} drawn
 * @param {boolean} byPressure
 * @param {Colours} c
 * @returns {Trace[]}
 */
function surfaceTraces(drawn, byPressure, c) {
  /** @param {Drawn} curve */
  const depth = (curve) => (byPressure ? curve.pressure : curve.cycles);
  const scale = scaleOf(c);
  return [
    {
      type: "surface",
      x: speeds(drawn[0].fitted),
      y: drawn.map(depth),
      z: drawn.map(({ fitted }) => torques(fitted)),
      colorscale: scale.map(([at], index) => [at, scale[scale.length - 1 - index][1]]),
      opacity: 0.86,
      showscale: false,
      hovertemplate: `%{x:.0f} rpm, %{y}<br>fit %{z:.2f} Nm<extra></extra>`,
    },
    {
      type: "scatter3d",
      mode: "markers",
      x: drawn.flatMap(({ measured }) => speeds(measured)),
      y: drawn.flatMap((curve) => curve.measured.map(() => depth(curve))),
      z: drawn.flatMap(({ measured }) => torques(measured)),
      marker: { size: 2.2, color: c.ink },
      hovertemplate: `%{x:.0f} rpm<br>measured %{z:.2f} Nm<extra></extra>`,
    },
  ];
}
