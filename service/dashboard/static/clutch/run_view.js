// A run opened: its curves with their fits, what the fits leave, and the record as it was sent.

import { Chart, chartsOf, choice, setControls } from "../charts/chart.js";
import { column } from "../charts/columns.js";
import { pressureRampOf } from "../charts/palette.js";
import { curvesOfRun } from "../charts/stribeck.js";
import { measuredOf, torqueAtSpeed } from "../charts/stribeck_law.js";
import { planar } from "../charts/traces.js";
import { offered } from "../shared/dom.js";
import { fixed, quantity } from "../shared/format.js";
import { named, pressureText, units } from "../shared/units.js";

/** @import { Reader } from "./reader.js" */

/** @type {(run: Receipt, reader: Reader) => Promise<HTMLElement | null>} null for a run without channels */
export async function runCharts(run, reader) {
  await reader.records([run.run_id]);
  const channels = reader.channels[run.run_id];
  const names = Object.keys(channels).filter((name) => name !== "time_s" && channels[name].length > 1);
  if (names.length === 0) return null;
  const id = `run-${run.run_id}`;
  const record = new Chart({ id: `${id}-record`, title: "The record as it was sent", height: 300, wide: true });
  const options = offered(names, quantity);
  const draw = (/** @type {string} */ channel) => {
    setControls(record, [choice("Channel", options, channel, draw)]);
    record.show(recordOf(channels, channel));
  };
  draw(names.includes("torque_nm") ? "torque_nm" : names[0]);
  if (run.fits.length === 0) return chartsOf(record);
  const curves = new Chart({ id: `${id}-curve`, title: "Curve and fit", height: 300 });
  const residuals = new Chart({ id: `${id}-residuals`, title: "Residuals of the fit", height: 300 });
  const clutch = reader.present();
  curves.show(curvesOfRun(run, channels, clutch));
  residuals.show(residualsOf(run, channels, clutch));
  return chartsOf(curves, residuals, record);
}

/** @type {(run: Receipt, channels: Channels, clutch: ClutchOut) => Spec} */
function residualsOf({ fits }, channels, clutch) {
  const torque = units().torque;
  const levels = fits.map((fit) => ({
    level: fit.pressure_bar,
    points: measuredOf(channels, fit.pressure_bar).map(({ speed, torque: measured }) => ({
      speed,
      left: torque.of(measured - torqueAtSpeed(speed, fit, clutch), fit.pressure_bar, clutch),
    })),
  }));
  const titles = ["sliding speed, rpm", named({ ...torque, name: "measured minus fitted" })];
  return {
    note: "Measured minus fitted torque, one colour per pressure. A good fit leaves no pattern.",
    columns: [
      column("pressure, bar", 2),
      column("speed, rpm"),
      { name: titles[1], text: (value) => fixed(value, torque.decimals + 1) },
    ],
    rows: levels.flatMap(({ level, points }) => points.map(({ speed, left }) => [level, speed, left])),
    figure: planar({ title: titles[0], zero: true }, titles[1], [], (c) =>
      levels.map(({ level, points }, index) => ({
        name: pressureText(level),
        x: points.map(({ speed }) => speed),
        y: points.map(({ left }) => left),
        marker: { color: pressureRampOf(c, index, levels.length), size: 5 },
      })),
    ),
  };
}

/** @type {(channels: Channels, channel: string) => Spec} */
function recordOf(channels, channel) {
  const { [channel]: values, time_s: time } = channels;
  const x = time ?? values.map((_, index) => index + 1);
  const along = time ? "time, s" : "row";
  const long =
    values.length >= 2000
      ? " Of a long record only the extremes are drawn; CSV and Parquet from the API contain all values."
      : "";
  return {
    note: `${fixed(values.length)} values.${long}`,
    columns: [column(along, time ? 3 : 0), column(quantity(channel), 3)],
    rows: values.map((value, index) => [x[index], value]),
    figure: planar(along, quantity(channel), [], (c) => [
      {
        name: quantity(channel),
        x,
        y: values,
        line: { color: c.accent, width: 1.2 },
        ...(time ? {} : { marker: { color: c.accent, size: 4 } }),
      },
    ]),
  };
}
