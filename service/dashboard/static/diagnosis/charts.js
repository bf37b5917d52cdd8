// The residuals between data and model, before and after the extension; and the loops under both.

import { Chart } from "../charts/chart.js";
import { column, HALF_OF_90 } from "../charts/columns.js";
import { blend } from "../charts/palette.js";
import { band } from "../charts/traces.js";
import { fixed, significant } from "../shared/format.js";

/** @typedef {"before" | "after"} Side */

/** @typedef {{ id: string, key: "speed_pressure" | "pressure_cycles", x: "speed_rpm" | "cycles", xName: string }} ResidualsMap */

/** @type {ResidualsMap[]} */
const MAPS = [
  { id: "map-speed", key: "speed_pressure", x: "speed_rpm", xName: "speed, rpm" },
  { id: "map-cycles", key: "pressure_cycles", x: "cycles", xName: "duty cycles" },
];
const PRESSURE = "pressure, bar";

/**
 * The diagnosis' charts, each with what it shows of a report (null: nothing).
 * @type {() => { chart: Chart, spec: (report: DiagnosisOut) => Spec | null }[]}
 */
export function charts() {
  const loops = new Chart({ id: "diagnosis-loops", title: "Loops under both models", wide: true, height: 380 });
  const law = new Chart({ id: "diagnosis-law", title: "The friction law and eq. 3", wide: true, height: 380 });
  return [
    { chart: law, spec: (report) => lawSpec(report.law_curves ?? []) },
    ...MAPS.map((map) => ({
      chart: new Chart({ id: map.id, title: `Residuals over ${map.id.slice(4)} and pressure`, height: 330 }),
      spec: (/** @type {DiagnosisOut} */ report) => mapSpec(report.maps, map),
    })),
    { chart: loops, spec: (report) => loopSpec(report.loops ?? []) },
  ];
}

/** @type {(maps: MapsOut | null | undefined, map: ResidualsMap) => Spec | null} */
function mapSpec(maps, map) {
  const { key, x, xName } = map;
  if (!maps?.before?.[key] || !maps.axes?.[x] || !maps.axes?.pressure_bar) return null;
  const [xs, ys] = [maps.axes[x], maps.axes.pressure_bar];
  const sides = /** @type {Side[]} */ (["before", "after"])
    .filter((side) => maps[side]?.[key])
    .map((side) => ({ side, z: key === "pressure_cycles" ? turned(maps[side][key], ys) : maps[side][key] }));
  return {
    note: "Mean of measured minus predicted torque, in standard deviations of the noise (σ). Pure noise stays pale. Both pictures use the same scale.",
    columns: [{ name: "model" }, column(xName), column(PRESSURE, 2), column("residual, sigma", 2)],
    rows: sides.flatMap(({ side, z }) => z.flatMap((row, j) => row.map((value, i) => [side, xs[i], ys[j], value]))),
    figure: (c) => heatmaps(sides, { xs, ys, xName }, c),
  };
}

/**
 * One or two maps beside each other, on one scale of colours.
 * @param {{ side: Side, z: Table }[]} sides
 * @param {{ xs: number[], ys: number[], xName: string }} axes
 * @param {Colours} c
 * @returns {Figure}
 */
function heatmaps(sides, { xs, ys, xName }, c) {
  const magnitudes = sides.flatMap(({ z }) => z.flat().flatMap((value) => (value === null ? [] : [Math.abs(value)])));
  const most = Math.max(1, ...magnitudes);
  const fill = (/** @type {number} */ value) => blend([c.fresh, c.panel, c.worn], 0.5 + value / (2 * most));
  const scale = [-most, -most / 2, most / 2, most].map((value) => ({
    ...band(`${significant(value, 2)} σ`, { x: [], y: [] }, { x: [], y: [] }, c),
    fill: fill(value),
  }));
  return sides.map(({ side, z }) => ({
    title: side,
    x: { title: xName, names: xs.map((value) => fixed(value)) },
    y: { title: PRESSURE, names: ys.map((value) => significant(value, 3)) },
    curves: scale,
    fields: [{ z: "residual, σ", x: [...xs.keys()], y: [...ys.keys()], values: z, fill }],
  }));
}

/** @type {(z: Table, ys: number[]) => Table} rows and columns exchanged */
const turned = (z, ys) => ys.map((_, j) => z.map((row) => row[j] ?? null));

/** @type {(curves: LawCurveOut[]) => Spec | null} measured friction curves beside eq. 3 and the law as found */
function lawSpec(curves) {
  if (curves.length === 0) return null;
  const shown = [...new Set([curves[0], curves.at(-1)])].flatMap((c) => c ?? []);
  return {
    note: "Measured points, eq. 3, and the law as found. The band holds the law with a probability of 90 %.",
    columns: [
      { name: "curve" },
      column("speed, rpm", 1),
      ...["measured, Nm", "eq. 3, Nm", "law, Nm", "sd, Nm"].map((name) => column(name, 3)),
    ],
    rows: curves.flatMap((curve) =>
      curve.speed_rpm.map((speed, at) => [
        curveName(curve),
        speed,
        ...[curve.measured_nm, curve.eq3_nm, curve.law_nm, curve.law_sd_nm].map((values) => values[at]),
      ]),
    ),
    figure: (c) =>
      shown.map((curve) => ({
        title: curveName(curve),
        x: { title: "speed, rpm", log: true },
        y: { title: "torque, Nm" },
        curves: lawCurves(curve, c),
      })),
  };
}

/** @type {(curve: LawCurveOut) => string} */
const curveName = ({ cycles, pressure_bar: pressure }) => `${fixed(cycles)} cycles, ${fixed(pressure, 1)} bar`;

/** @type {(curve: LawCurveOut, c: Colours) => Curve[]} */
function lawCurves({ speed_rpm: x, measured_nm: measured, eq3_nm: eq3, law_nm: law, law_sd_nm: sd }, c) {
  /** @type {(sign: number) => Places} */
  const edge = (sign) => ({ x, y: law.map((torque, at) => (torque ?? 0) + sign * HALF_OF_90 * (sd[at] ?? 0)) });
  return [
    band("", edge(-1), edge(1), c),
    { name: "measured", x, y: measured, marker: { size: 4, color: c.quiet } },
    { name: "eq. 3", x, y: eq3, line: { color: c.worn, dash: "dash" } },
    { name: "law as found", x, y: law, line: { color: c.accent } },
  ];
}

const KINDS = /** @type {const} */ (["measured", "baseline", "extended"]);
/** @typedef {(typeof KINDS)[number]} Kind */

/** @type {(loops: LoopTraceOut[]) => Spec | null} */
function loopSpec(loops) {
  if (loops.length === 0) return null;
  const kinds = KINDS.filter((kind) => loops.every((loop) => loop[`${kind}_nm`]));
  const shown = loops.slice(0, 3);
  return {
    note: "Measured points beside the baseline and the extended model.",
    columns: [{ name: "loop" }, { name: "model" }, column("speed, rpm", 1), column("torque, Nm", 2)],
    rows: loops.flatMap((loop) =>
      kinds.flatMap((kind) =>
        loop.speed_rpm.map((speed, index) => [loopName(loop), kind, speed, loop[`${kind}_nm`][index]]),
      ),
    ),
    figure: (c) =>
      shown.map((loop) => ({
        title: loopName(loop),
        x: { title: "speed, rpm" },
        y: { title: "torque, Nm" },
        curves: kinds.map((kind) => loopCurve(loop, kind, c)),
      })),
  };
}

/** @param {LoopTraceOut} loop */
function loopName({ cycles, pressure_bar: pressure, frequency_hz: frequency }) {
  const rate = frequency ? `, ${significant(frequency, 2)} Hz` : "";
  return `${fixed(cycles)} cycles, ${fixed(pressure, 1)} bar${rate}`;
}

/** @type {(loop: LoopTraceOut, kind: Kind, c: Colours) => Curve} */
function loopCurve(loop, kind, c) {
  const at = { name: kind, x: loop.speed_rpm, y: loop[`${kind}_nm`] };
  if (kind === "measured") return { ...at, marker: { size: 3, color: c.quiet } };
  return { ...at, line: kind === "baseline" ? { color: c.worn, dash: "dash" } : { color: c.accent } };
}
