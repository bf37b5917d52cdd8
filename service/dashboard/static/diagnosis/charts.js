// The residuals between data and model, before and after the extension; and the loops under both.

import { Chart } from "../charts/chart.js";
import { column } from "../charts/columns.js";
import { titled } from "../charts/traces.js";
import { fixed, significant } from "../shared/format.js";

/** @typedef {"before" | "after"} Side */

/** @typedef {{ id: string, key: "speed_pressure" | "pressure_cycles", x: "speed_rpm" | "cycles", xName: string }} ResidualsMap */

const NARROW = matchMedia("(max-width: 600px)");

/** @type {ResidualsMap[]} */
const MAPS = [
  { id: "map-speed", key: "speed_pressure", x: "speed_rpm", xName: "speed, rpm" },
  { id: "map-cycles", key: "pressure_cycles", x: "cycles", xName: "duty cycles" },
];
const PRESSURE = "pressure, bar";

/**
 * The diagnosis' charts, each with what it shows of a report (null: nothing); `name`: the start of saved files' names.
 * @type {(name: () => string) => { chart: Chart, spec: (report: DiagnosisOut) => Spec | null }[]}
 */
export function charts(name) {
  const loops = new Chart({ id: "diagnosis-loops", title: "Loops under both models", name, wide: true, height: 380 });
  const law = new Chart({ id: "diagnosis-law", title: "The friction law and eq. 3", name, wide: true, height: 380 });
  return [
    { chart: law, spec: (report) => lawSpec(report.law_curves ?? []) },
    ...MAPS.map((map) => ({
      chart: new Chart({ id: map.id, title: `Residuals over ${map.id.slice(4)} and pressure`, name, height: 330 }),
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
    figure: (c) => ({
      data: heatmaps(sides, { xs, ys, xName }, c),
      layout: mapLayout(sides, xName),
    }),
  };
}

/**
 * @param {{ side: Side, z: Table }[]} sides
 * @param {{ xs: number[], ys: number[], xName: string }} axes
 * @param {Colours} c
 * @returns {Trace[]}
 */
function heatmaps(sides, { xs, ys, xName }, c) {
  const magnitudes = sides.flatMap(({ z }) => z.flat().flatMap((value) => (value === null ? [] : [Math.abs(value)])));
  const most = Math.max(1, ...magnitudes);
  return sides.map(({ side, z }, index) => ({
    type: "heatmap",
    x: xs.map((value) => fixed(value)),
    y: ys.map((value) => significant(value, 3)),
    z,
    zmin: -most,
    zmax: most,
    xaxis: index ? "x2" : "x",
    yaxis: "y",
    xgap: 1,
    ygap: 1,
    colorscale: [
      [0, c.fresh],
      [0.5, c.panel],
      [1, c.worn],
    ],
    showscale: index === sides.length - 1,
    colorbar: { ...titled("σ"), thickness: 12, outlinewidth: 0 },
    hovertemplate: `${side}<br>${xName} %{x}<br>${PRESSURE} %{y}<br>%{z:.2f} σ<extra></extra>`,
  }));
}

/** @type {(sides: { side: Side }[], xName: string) => Layout} one or two maps beside each other, each under its name */
function mapLayout(sides, xName) {
  const two = sides.length > 1;
  /** @type {(domain: [number, number]) => Axis} */
  const abscissa = (domain) => ({
    ...titled(xName),
    domain,
    type: "category",
    nticks: NARROW.matches ? 3 : 5,
    tickangle: 0,
    showgrid: false,
  });
  const middles = two ? [0.24, 0.76] : [0.5];
  return {
    grid: { rows: 1, columns: sides.length },
    hovermode: "closest",
    xaxis: abscissa(two ? [0, 0.48] : [0, 1]),
    ...(two ? { xaxis2: abscissa([0.52, 1]) } : {}),
    yaxis: { ...titled(PRESSURE), type: "category", showgrid: false },
    margin: { t: 30 },
    annotations: sides.map(({ side }, index) => ({
      text: `<b>${side}</b>`,
      x: middles[index],
      xref: "paper",
      y: 1,
      yref: "paper",
      yanchor: "bottom",
      showarrow: false,
    })),
  };
}

/** @type {(z: Table, ys: number[]) => Table} rows and columns exchanged */
const turned = (z, ys) => ys.map((_, j) => z.map((row) => row[j] ?? null));

/** @type {(curves: LawCurveOut[]) => Spec | null} measured friction curves beside eq. 3 and the law as found */
function lawSpec(curves) {
  if (curves.length === 0) return null;
  const shown = NARROW.matches ? curves.slice(0, 1) : [...new Set([curves[0], curves.at(-1)])].flatMap((c) => c ?? []);
  return {
    note: `${shown.map(curveName).join(" · ")}. The band holds the law with a probability of 90 %.`,
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
    figure: (c) => ({
      data: shown.flatMap((curve, place) => lawTraces(curve, place, c)),
      layout: {
        grid: { rows: 1, columns: shown.length, pattern: "independent", xgap: 0.12 },
        ...Object.fromEntries(
          shown.flatMap((_, place) => [
            [`xaxis${suffix(place)}`, { ...titled("speed, rpm"), type: "log" }],
            [`yaxis${suffix(place)}`, titled(place ? "" : "torque, Nm")],
          ]),
        ),
      },
    }),
  };
}

/** @type {(curve: LawCurveOut) => string} */
const curveName = ({ cycles, pressure_bar: pressure }) => `${fixed(cycles)} cycles, ${fixed(pressure, 1)} bar`;

/** @type {(curve: LawCurveOut, place: number, c: Colours) => PlainTrace[]} */
function lawTraces(curve, place, c) {
  const axes = { x: curve.speed_rpm, xaxis: `x${suffix(place)}`, yaxis: `y${suffix(place)}` };
  const legend = { showlegend: place === 0 };
  /** @type {(sign: number) => (number | null)[]} */
  const end = (sign) => curve.law_nm.map((torque, at) => (torque ?? 0) + sign * 1.645 * (curve.law_sd_nm[at] ?? 0));
  const edge = {
    ...axes,
    mode: "lines",
    line: { width: 0, color: c.accent },
    showlegend: false,
    hoverinfo: /** @type {const} */ ("skip"),
  };
  return [
    { ...edge, y: end(-1) },
    { ...edge, y: end(1), fill: "tonexty", fillcolor: `${c.accent}33` },
    {
      ...axes,
      ...legend,
      name: "measured",
      y: curve.measured_nm,
      mode: "markers",
      marker: { size: 4, color: c.quiet },
    },
    {
      ...axes,
      ...legend,
      name: "eq. 3",
      y: curve.eq3_nm,
      mode: "lines",
      line: { width: 2, color: c.worn, dash: "dash" },
    },
    { ...axes, ...legend, name: "law as found", y: curve.law_nm, mode: "lines", line: { width: 2, color: c.accent } },
  ];
}

const KINDS = /** @type {const} */ (["measured", "baseline", "extended"]);
/** @typedef {(typeof KINDS)[number]} Kind */

/** @type {(loops: LoopTraceOut[]) => Spec | null} */
function loopSpec(loops) {
  if (loops.length === 0) return null;
  const kinds = KINDS.filter((kind) => loops.every((loop) => loop[`${kind}_nm`]));
  const shown = loops.slice(0, NARROW.matches ? 1 : 3);
  const axes = shown.flatMap((_, place) => [
    [`xaxis${suffix(place)}`, titled("speed, rpm")],
    [`yaxis${suffix(place)}`, titled(place ? "" : "torque, Nm")],
  ]);
  return {
    note: shown.map(loopName).join(" · "),
    columns: [{ name: "loop" }, { name: "model" }, column("speed, rpm", 1), column("torque, Nm", 2)],
    rows: loops.flatMap((loop) =>
      kinds.flatMap((kind) =>
        loop.speed_rpm.map((speed, index) => [loopName(loop), kind, speed, loop[`${kind}_nm`][index]]),
      ),
    ),
    figure: (c) => ({
      data: shown.flatMap((loop, place) => kinds.map((kind) => loopTrace(loop, place, kind, c))),
      layout: {
        grid: { rows: 1, columns: shown.length, pattern: "independent", xgap: 0.12 },
        ...Object.fromEntries(axes),
      },
    }),
  };
}

/** @type {(place: number) => string} what the plotting library adds to an axis' name: nothing to the first one's */
const suffix = (place) => (place ? String(place + 1) : "");

/** @param {LoopTraceOut} loop */
function loopName({ cycles, pressure_bar: pressure, frequency_hz: frequency }) {
  const rate = frequency ? `, ${significant(frequency, 2)} Hz` : "";
  return `${fixed(cycles)} cycles, ${fixed(pressure, 1)} bar${rate}`;
}

/** @type {(loop: LoopTraceOut, place: number, kind: Kind, c: Colours) => PlainTrace} */
function loopTrace(loop, place, kind, c) {
  const baseline = kind === "baseline";
  return {
    name: kind,
    showlegend: place === 0,
    legendgroup: kind,
    x: loop.speed_rpm,
    y: loop[`${kind}_nm`],
    xaxis: `x${suffix(place)}`,
    yaxis: `y${suffix(place)}`,
    mode: kind === "measured" ? "markers" : "lines",
    marker: { size: 3, color: c.quiet },
    line: { width: 2, color: baseline ? c.worn : c.accent, dash: baseline ? "dash" : "solid" },
    hovertemplate: `${kind}<br>%{x:.0f} rpm, %{y:.2f} Nm<extra></extra>`,
  };
}
