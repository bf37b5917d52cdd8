// Friction loops: by state at one pressure (figs. 12, 15), by pressure at one state (fig. 13), their area (figs. 14, 17).

import { fixed, significant } from "./format.js";
import { eventMarks } from "./layout.js";

const MOST = 1500;
/** Bar about a level that still belong to it: on the way to the next one torque is of neither. */
const NEAR = 0.1;

export const loopPressures = (loops) => [...new Set(loops.map((loop) => loop.pressure_bar))].sort((a, b) => a - b);

/** The record near a pressure, in its order, thinned evenly. */
function traceOf({ pressure_bar: p, speed_rpm: n, torque_nm: m }, pressure) {
  const found = [];
  for (let index = 0; index < n.length; index += 1) if (Math.abs(p[index] - pressure) <= NEAR) found.push([n[index], m[index]]);
  const step = Math.ceil(found.length / MOST);
  return step > 1 ? found.filter((_, index) => index % step === 0) : found;
}

/** Torque over speed of some loops; `over` says whether the colour is the state or the pressure. */
export function loopCurves({ loops, channels, over, pressure, run }) {
  const byState = over === "state";
  const own = loops.filter((loop) => channels[loop.run_id] && (byState ? loop.pressure_bar === pressure : loop.run_id === run));
  const drawn = own.map((loop) => ({ loop, trace: traceOf(channels[loop.run_id], loop.pressure_bar) })).filter(({ trace }) => trace.length > 2);
  if (drawn.length === 0) return { empty: "No dynamic Stribeck test yet. Send one as kind dynamic_stribeck: speed swept to and fro at constant pressure, sampled." };
  const label = (loop) => (byState ? `${fixed(loop.cycles)} cycles` : `${fixed(loop.pressure_bar, 1)} bar`);
  return {
    note: byState ? `At ${fixed(pressure, 1)} bar, from the first dynamic test to the last.` : `After ${fixed(drawn[0].loop.cycles)} cycles, at every pressure.`,
    columns: [{ name: "cycles", text: (value) => fixed(value) }, { name: "pressure, bar", text: (value) => fixed(value, 1) }, { name: "speed, rpm", text: (value) => fixed(value, 1) }, { name: "torque, Nm", text: (value) => fixed(value, 2) }],
    rows: drawn.flatMap(({ loop, trace }) => trace.map(([speed, torque]) => [loop.cycles, loop.pressure_bar, speed, torque])),
    figure: (c) => ({
      data: drawn.map(({ loop, trace }, index) => ({
        name: label(loop), mode: "lines", x: trace.map((point) => point[0]), y: trace.map((point) => point[1]),
        line: { color: c.ramp(drawn.length > 1 ? index / (drawn.length - 1) : 0), width: 1.3 }, hovertemplate: `${label(loop)}<br>%{x:.0f} rpm, %{y:.2f} Nm<extra></extra>`,
      })),
      layout: { xaxis: { title: { text: "sliding speed, rpm" } }, yaxis: { title: { text: "friction torque, Nm" } } },
    }),
  };
}

/** The loops' area over cycles, a line a pressure. */
export function loopAreas({ loops, events }) {
  const known = loops.filter((loop) => loop.loop_area_nm_m_s !== null);
  if (known.length === 0) return { empty: loops.length > 0 ? "None of the records holds a whole closed period (eq. 8)." : "The area is known from the first dynamic Stribeck test on." };
  const pressures = loopPressures(known);
  return {
    note: "Area of whole closed periods (eq. 8): positive where torque is higher in acceleration. 90 % error bars.",
    columns: [{ name: "cycles", text: (value) => fixed(value) }, { name: "pressure, bar", text: (value) => fixed(value, 1) }, { name: "frequency, Hz", text: (value) => significant(value, 3) }, { name: "loop area, Nm·m/s", text: (value) => significant(value, 3) }, { name: "standard deviation", text: (value) => significant(value, 2) }, { name: "attractor, Nm·s", text: (value) => significant(value, 3) }],
    rows: known.map((loop) => [loop.cycles, loop.pressure_bar, loop.frequency_hz, loop.loop_area_nm_m_s, loop.loop_area_sd_nm_m_s, loop.attractor_nm_s]),
    figure: (c) => ({
      data: pressures.map((pressure, index) => {
        const own = known.filter((loop) => loop.pressure_bar === pressure);
        const colour = c.ramp(pressures.length > 1 ? index / (pressures.length - 1) : 0);
        return {
          name: `${fixed(pressure, 1)} bar`, mode: "lines+markers", x: own.map((loop) => loop.cycles), y: own.map((loop) => loop.loop_area_nm_m_s), line: { color: colour, width: 1.4 }, marker: { color: colour, size: 7 },
          error_y: { type: "data", array: own.map((loop) => 1.645 * (loop.loop_area_sd_nm_m_s ?? 0)), thickness: 1, width: 3, color: colour }, hovertemplate: "%{x:,.0f} cycles<br>%{y:.3g} Nm·m/s<extra></extra>",
        };
      }),
      layout: { xaxis: { title: { text: "duty cycles" } }, yaxis: { title: { text: "loop area, Nm·m/s" } }, ...eventMarks(events, c) },
    }),
  };
}
