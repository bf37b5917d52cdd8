// Stribeck curves: at one pressure by state (fig. 7), and as surfaces over pressure (figs. 6, 8) or over cycles (fig. 7).

import { fixed } from "./format.js";
import { faint, scaleOf } from "./palette.js";
import { curveOf, measuredOf } from "./stribeck.js";

export const COLUMNS = [
  { name: "kind" }, { name: "cycles", text: (value) => fixed(value) }, { name: "pressure, bar", text: (value) => fixed(value, 2) },
  { name: "speed, rpm", text: (value) => fixed(value) }, { name: "torque, Nm", text: (value) => fixed(value, 2) }];

/** A few tests spread over the life, the first and the last among them. */
export function spread(tests, most = 6) {
  if (tests.length <= most) return tests;
  return Array.from({ length: most }, (_, index) => tests[Math.round((index * (tests.length - 1)) / (most - 1))]);
}

export const pressuresOf = (tests) => [...new Set(tests.flatMap((test) => test.fits.map((fit) => fit.pressure_bar)))].sort((a, b) => a - b);

const fastest = (channels) => Math.max(100, ...Object.values(channels).map(({ speed_rpm: speeds }) => speeds.reduce((most, speed) => Math.max(most, speed), 0)));

/** What is drawn of some tests at some pressures: measured points where the channels are known, the fit in any case. */
function drawnOf(tests, channels, clutch, wanted) {
  const end = fastest(channels);
  return tests.flatMap((test) => test.fits.filter((fit) => wanted(fit.pressure_bar)).map((fit) => ({
    cycles: test.cycles, pressure: fit.pressure_bar, acceptable: fit.acceptable,
    measured: channels[test.run_id] ? measuredOf(channels[test.run_id], fit.pressure_bar) : [], fitted: curveOf(fit, clutch, 0, end),
  })));
}

const rowsOf = (drawn) => drawn.flatMap(({ cycles, pressure, measured, fitted }) => [
  ...measured.map((point) => ["measured", cycles, pressure, point.speed, point.torque]),
  ...fitted.map((point) => ["fit", cycles, pressure, point.speed, point.torque])]);

/** Torque over speed at one pressure, a colour a state. */
export function flat({ tests, channels, clutch, pressure }) {
  const drawn = drawnOf(spread(tests), channels, clutch, (each) => each === pressure);
  if (drawn.length === 0) return { empty: "No stationary Stribeck test yet at this pressure." };
  return {
    note: `At ${fixed(pressure, 1)} bar: points measured, lines fitted (eq. 3), from the first test to the last.`,
    columns: COLUMNS, rows: rowsOf(drawn),
    figure: (c) => ({
      data: drawn.flatMap(({ cycles, measured, fitted }, index) => {
        const colour = c.ramp(drawn.length > 1 ? index / (drawn.length - 1) : 0);
        const name = `${fixed(cycles)} cycles`;
        const shared = { legendgroup: name, name, hovertemplate: `${name}<br>%{x:.0f} rpm, %{y:.2f} Nm<extra></extra>` };
        return [
          { ...shared, mode: "lines", x: fitted.map((p) => p.speed), y: fitted.map((p) => p.torque), line: { color: colour, width: 2 } },
          { ...shared, showlegend: false, mode: "markers", x: measured.map((p) => p.speed), y: measured.map((p) => p.torque), marker: { color: faint(c.panel, 1), size: 5, line: { color: colour, width: 1.4 } } }];
      }),
      layout: { xaxis: { title: { text: "sliding speed, rpm" }, rangemode: "tozero" }, yaxis: { title: { text: "friction torque, Nm" } } },
    }),
  };
}

/** The surface of one state over speed and pressure (figs. 6, 8), or of one pressure over speed and cycles (fig. 7). */
export function surface({ tests, channels, clutch, over, pressure, run }) {
  const byPressure = over === "pressure";
  const chosen = byPressure ? tests.filter((test) => test.run_id === run) : spread(tests, 9);
  const drawn = drawnOf(chosen, channels, clutch, (each) => byPressure || each === pressure);
  if (drawn.length < 2) return { empty: byPressure ? "A surface needs a test at two pressures or more." : "A surface needs two tests or more." };
  const depth = (each) => (byPressure ? each.pressure : each.cycles);
  const title = byPressure ? "pressure, bar" : "duty cycles";
  return {
    note: byPressure ? `After ${fixed(drawn[0].cycles)} cycles: points measured, surface fitted. Drag to turn.` : `At ${fixed(pressure, 1)} bar over the life: points measured, surface fitted. Drag to turn.`,
    columns: COLUMNS, rows: rowsOf(drawn),
    figure: (c) => ({
      data: [
        { type: "surface", x: drawn[0].fitted.map((p) => p.speed), y: drawn.map(depth), z: drawn.map(({ fitted }) => fitted.map((p) => p.torque)), colorscale: scaleOf(c).map(([at], index, all) => [at, all[all.length - 1 - index][1]]), opacity: 0.86, showscale: false, hovertemplate: `%{x:.0f} rpm, %{y}<br>fit %{z:.2f} Nm<extra></extra>` },
        { type: "scatter3d", mode: "markers", x: drawn.flatMap(({ measured }) => measured.map((p) => p.speed)), y: drawn.flatMap((each) => each.measured.map(() => depth(each))), z: drawn.flatMap(({ measured }) => measured.map((p) => p.torque)), marker: { size: 2.2, color: c.ink }, hovertemplate: `%{x:.0f} rpm<br>measured %{z:.2f} Nm<extra></extra>` }],
      layout: { showlegend: false, scene: { xaxis: { title: { text: "speed, rpm" } }, yaxis: { title: { text: title } }, zaxis: { title: { text: "torque, Nm" } } } },
    }),
  };
}
