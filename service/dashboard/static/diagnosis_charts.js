// What is left between data and model, before and after the extension; and the loops under both.

import { Chart } from "./chart.js";
import { fixed, significant } from "./format.js";

const NARROW = matchMedia("(max-width: 600px)");

const MAPS = [
  { id: "map-speed", title: "What is left, over speed and pressure", key: "speed_pressure", columnwise: false, x: "speed_rpm", y: "pressure_bar", xName: "speed, rpm", yName: "pressure, bar" },
  { id: "map-cycles", title: "What is left, over cycles and pressure", key: "pressure_cycles", columnwise: true, x: "cycles", y: "pressure_bar", xName: "duty cycles", yName: "pressure, bar" },
];

/** The diagnosis' charts, each with what it shows of a report (null: nothing). */
export function charts(name) {
  return [
    ...MAPS.map((map) => ({ chart: new Chart({ id: map.id, title: map.title, name, height: 330 }), spec: (report) => mapSpec(report.maps, map) })),
    { chart: new Chart({ id: "diagnosis-loops", title: "Loops under both models", name, wide: true, height: 380 }), spec: (report) => loopSpec(report.loops ?? []) }];
}

/** `columnwise` tables come with a row an x; all are drawn with a row a y. */
function mapSpec(maps, { key, columnwise, x, y, xName, yName }) {
  if (!maps?.before?.[key] || !maps.axes?.[x] || !maps.axes?.[y]) return null;
  const [xs, ys] = [maps.axes[x], maps.axes[y]];
  const sides = ["before", "after"].filter((side) => maps[side]?.[key]).map((side) => [side, columnwise ? turned(maps[side][key], ys) : maps[side][key]]);
  const most = Math.max(1, ...sides.flatMap(([, z]) => z.flat().filter((value) => value !== null).map(Math.abs)));
  return {
    note: "Mean residual in units of sigma: what is only noise stays pale. The scale is the same before and after.",
    columns: [{ name: "model" }, { name: xName, text: (value) => fixed(value) }, { name: yName, text: (value) => fixed(value, 2) }, { name: "residual, sigma", text: (value) => fixed(value, 2) }],
    rows: sides.flatMap(([side, z]) => z.flatMap((row, j) => row.map((value, i) => [side, xs[i], ys[j], value]))),
    figure: (c) => ({
      data: sides.map(([side, z], index) => ({
        type: "heatmap", x: xs.map((value) => fixed(value)), y: ys.map((value) => significant(value, 3)), z, zmin: -most, zmax: most, xaxis: index ? "x2" : "x", yaxis: "y", xgap: 1, ygap: 1,
        colorscale: [[0, c.fresh], [0.5, c.panel], [1, c.worn]], showscale: index === sides.length - 1, colorbar: { title: { text: "σ" }, thickness: 12, outlinewidth: 0 },
        hovertemplate: `${side}<br>${xName} %{x}<br>${yName} %{y}<br>%{z:.2f} σ<extra></extra>`,
      })),
      layout: {
        grid: { rows: 1, columns: sides.length }, hovermode: "closest",
        xaxis: { title: { text: xName }, domain: sides.length > 1 ? [0, 0.48] : [0, 1], type: "category", nticks: NARROW.matches ? 3 : 5, tickangle: 0, showgrid: false },
        ...(sides.length > 1 ? { xaxis2: { title: { text: xName }, domain: [0.52, 1], type: "category", nticks: NARROW.matches ? 3 : 5, tickangle: 0, showgrid: false } } : {}),
        yaxis: { title: { text: yName }, type: "category", showgrid: false }, margin: { t: 30 },
        annotations: sides.map(([side], index) => ({ text: `<b>${side}</b>`, x: index ? 0.76 : sides.length > 1 ? 0.24 : 0.5, xref: "paper", y: 1, yref: "paper", yanchor: "bottom", showarrow: false })),
      },
    }),
  };
}

/** Rows and columns exchanged. */
const turned = (z, ys) => ys.map((_, j) => z.map((row) => row[j] ?? null));

function loopSpec(loops) {
  if (loops.length === 0) return null;
  const kinds = [["measured", "measured_nm"], ["baseline", "baseline_nm"], ["extended", "extended_nm"]].filter(([, key]) => loops.every((loop) => loop[key]));
  const label = (loop) => `${fixed(loop.cycles)} cycles, ${fixed(loop.pressure_bar, 1)} bar${loop.frequency_hz ? `, ${significant(loop.frequency_hz, 2)} Hz` : ""}`;
  const shown = loops.slice(0, NARROW.matches ? 1 : 3);
  return {
    note: shown.map(label).join(" · "),
    columns: [{ name: "loop" }, { name: "model" }, { name: "speed, rpm", text: (value) => fixed(value, 1) }, { name: "torque, Nm", text: (value) => fixed(value, 2) }],
    rows: loops.flatMap((loop) => kinds.flatMap(([kind, key]) => loop.speed_rpm.map((speed, index) => [label(loop), kind, speed, loop[key][index]]))),
    figure: (c) => ({
      data: shown.flatMap((loop, place) => kinds.map(([kind, key]) => ({
        name: kind, showlegend: place === 0, legendgroup: kind, x: loop.speed_rpm, y: loop[key], xaxis: place ? `x${place + 1}` : "x", yaxis: place ? `y${place + 1}` : "y",
        mode: kind === "measured" ? "markers" : "lines", marker: { size: 3, color: c.quiet }, line: { width: 2, color: kind === "baseline" ? c.worn : c.accent, dash: kind === "baseline" ? "dash" : "solid" }, hovertemplate: `${kind}<br>%{x:.0f} rpm, %{y:.2f} Nm<extra></extra>`,
      }))),
      layout: {
        grid: { rows: 1, columns: shown.length, pattern: "independent", xgap: 0.12 },
        ...Object.fromEntries(shown.flatMap((_, place) => [[`xaxis${place ? place + 1 : ""}`, { title: { text: "speed, rpm" } }], [`yaxis${place ? place + 1 : ""}`, { title: { text: place ? "" : "torque, Nm" } }]])),
      },
    }),
  };
}
