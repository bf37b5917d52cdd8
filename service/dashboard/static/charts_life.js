// The remaining life: mean COF and where it goes, what was foretold when, mean COF at every pressure.

import { cycles, fixed, interval, withSd } from "./format.js";
import { eventMarks } from "./layout.js";
import { faint } from "./palette.js";

const CYCLES = { name: "cycles", text: (value) => fixed(value) };
const COF = (name) => ({ name, text: (value) => fixed(value, 4) });

/** How far the abscissa goes: past what was foretold, but not so far that the measurements vanish. */
function lastCycle(life, measured) {
  const seen = Math.max(1, life.as_of_cycles ?? 0, ...measured);
  const end = life.end_of_life_cycles;
  const ahead = end["0.95"] ?? 1.5 * (end["0.5"] ?? seen);
  return Math.max(1.08 * seen, Math.min(1.06 * ahead, 4 * seen));
}

/** Mean COF, its law with the 90 % band, the threshold and when it is reached; behind it what was said before. */
export function fan({ life, pooled, foretold, events }) {
  if (!pooled) return { empty: "Mean COF is known from the first stationary test on." };
  const { measured, trajectory } = pooled;
  const threshold = life.criterion.threshold_mean_cof;
  const end = life.end_of_life_cycles;
  const last = lastCycle(life, measured.cycles);
  const note = life.status === "insufficient_data"
    ? "Too few tests to foretell anything: three at different cycles are needed."
    : `Mean COF ${withSd(life.current.mean_cof, life.current.mean_cof_sd)}; it ${end["0.5"] !== null && life.status === "reached" ? "reached" : "reaches"} ${fixed(threshold, 4)}, ${fixed(100 * life.criterion.fraction)} % of new, ${end["0.5"] === null ? "perhaps never" : `at about ${cycles(end["0.5"], end["0.05"], end["0.95"])} cycles (90 %: ${interval(end)})`}.`;
  return {
    note,
    columns: [{ name: "kind" }, CYCLES, COF("mean COF"), COF("lower, 5 %"), COF("upper, 95 %")],
    rows: [
      ...measured.cycles.map((at, index) => ["measured", at, measured.value[index], measured.value[index] - 1.645 * measured.sd[index], measured.value[index] + 1.645 * measured.sd[index]]),
      ...trajectory.cycles.map((at, index) => ["law", at, trajectory.median[index], trajectory.lower[index], trajectory.upper[index]]),
      ...(threshold === null ? [] : Object.entries(end).map(([quantile, at]) => [`end of life, ${100 * Number(quantile)} %`, at, threshold, null, null])),
    ],
    figure: (c) => {
      const marks = eventMarks(events, c);
      return {
        data: [...past(foretold, threshold, c), ...law(trajectory, life, c), ...endOfLife(life, threshold, c), points(measured, c)],
        layout: {
          xaxis: { title: { text: "duty cycles" }, range: [-0.01 * last, last] },
          yaxis: { title: { text: "mean COF" } },
          shapes: [...marks.shapes, ...(threshold === null ? [] : [{ type: "line", x0: 0, x1: 1, xref: "paper", y0: threshold, y1: threshold, line: { color: c.failure, width: 1.6, dash: "dash" } }])],
          annotations: [...marks.annotations, ...(threshold === null ? [] : [{ x: 0, xref: "paper", xanchor: "left", y: threshold, yanchor: "bottom", text: `threshold ${fixed(threshold, 4)}`, showarrow: false, font: { color: c.failure, size: 12 } }])],
        },
      };
    },
  };
}

const points = (measured, c) => ({
  name: "measured", mode: "markers", x: measured.cycles, y: measured.value, marker: { color: c.ink, size: 7 },
  error_y: { type: "data", array: measured.sd.map((sd) => 1.645 * sd), color: c.ink, thickness: 1.2, width: 3 },
  hovertemplate: "%{x:,.0f} cycles<br>mean COF %{y:.4f}<extra></extra>",
});

/** Each earlier prediction as a line from where the clutch stood to where the threshold was foretold. */
function past(foretold, threshold, c) {
  if (threshold === null) return [];
  const x = [];
  const y = [];
  for (const { at, cof, remaining } of foretold.slice(0, -1)) {
    if (remaining.value !== null && remaining.value > 0 && cof !== null) {
      x.push(at, at + remaining.value, null);
      y.push(cof, threshold, null);
    }
  }
  return x.length === 0 ? [] : [{ name: "foretold before", mode: "lines", x, y, line: { color: faint(c.quiet, 0.45), width: 1 }, hoverinfo: "skip" }];
}

function law(trajectory, life, c) {
  const end = life.end_of_life_cycles;
  const threshold = life.criterion.threshold_mean_cof;
  const last = trajectory.cycles.at(-1);
  const [low, middle, high] = ["0.05", "0.5", "0.95"].map((name) => end[name]);
  const beyond = threshold !== null && life.status === "predicted" && middle !== null && middle > last;
  const joined = (values, at) => (beyond && at !== null && at > last ? [[...trajectory.cycles, at], [...values, threshold]] : [trajectory.cycles, values]);
  const [lx, ly] = joined(trajectory.lower, low);
  const [ux, uy] = joined(trajectory.upper, high);
  const [mx, my] = joined(trajectory.median, middle);
  const edge = { mode: "lines", line: { width: 0 }, hoverinfo: "skip", showlegend: false };
  return [
    { ...edge, x: lx, y: ly },
    { ...edge, x: ux, y: uy, fill: "tonexty", fillcolor: faint(c.accent, 0.2), name: "90 % of its law", showlegend: true },
    { name: "law (eq. 6)", mode: "lines", x: mx, y: my, line: { color: c.accent, width: 2.2 }, hovertemplate: "%{x:,.0f} cycles<br>law %{y:.4f}<extra></extra>" },
  ];
}

function endOfLife(life, threshold, c) {
  const q = life.end_of_life_cycles;
  if (threshold === null || q["0.5"] === null) return [];
  const bar = (from, to, width, name, show) => ({ name, showlegend: show, mode: "lines", x: [q[from], q[to] ?? 10 * q["0.5"]], y: [threshold, threshold], line: { color: c.worn, width }, hoverinfo: "skip" });
  return [
    bar("0.05", "0.95", 5, "end of life, 90 % and 50 %", true), bar("0.25", "0.75", 11, "", false),
    { name: "median", showlegend: false, mode: "markers", x: [q["0.5"]], y: [threshold], marker: { color: c.panel, size: 9, line: { color: c.worn, width: 3 } }, hovertemplate: "end of life<br>%{x:,.0f} cycles<extra></extra>" },
  ];
}

/** Remaining cycles as they were foretold at each test, against what is known now. */
export function foretelling({ life, foretold, events }) {
  const known = foretold.filter(({ remaining }) => remaining.value !== null);
  if (known.length === 0) return { empty: "From the third stationary test on the remaining cycles are foretold." };
  const top = 1.12 * Math.max(1, ...known.map(({ remaining: r }) => Math.min(r.upper ?? Infinity, 2.2 * r.value + 1)));
  const end = life.end_of_life_cycles["0.5"];
  const x = known.map(({ at }) => at);
  const clipped = (value) => Math.min(value ?? Infinity, 4 * top);
  return {
    note: `The median and its 90 % interval, as said then. ${end === null ? "" : "A prophet would have walked down the dashed line to today's end of life."}`,
    columns: [CYCLES, { name: "remaining cycles", text: fixed }, { name: "lower, 5 %", text: fixed }, { name: "upper, 95 %", text: fixed }],
    rows: foretold.map(({ at, remaining: r }) => [at, r.value, r.lower, r.upper]),
    figure: (c) => {
      const edge = { mode: "lines", line: { width: 0 }, hoverinfo: "skip", showlegend: false, x };
      return {
        data: [
          { ...edge, y: known.map(({ remaining }) => remaining.lower ?? 0) },
          { ...edge, y: known.map(({ remaining }) => clipped(remaining.upper)), fill: "tonexty", fillcolor: faint(c.accent, 0.2), name: "90 % interval", showlegend: true },
          ...(end === null ? [] : [{ name: "today's median", mode: "lines", x: [0, end], y: [end, 0], line: { color: c.worn, width: 1.6, dash: "dash" }, hoverinfo: "skip" }]),
          { name: "median foretold", mode: "lines+markers", x, y: known.map(({ remaining }) => remaining.value), line: { color: c.accent, width: 2 }, marker: { size: 6 }, hovertemplate: "said at %{x:,.0f} cycles<br>%{y:,.0f} cycles remain<extra></extra>" },
        ],
        layout: { xaxis: { title: { text: "duty cycles when it was said" } }, yaxis: { title: { text: "remaining cycles" }, range: [0, top] }, ...eventMarks(events, c) },
      };
    },
  };
}

/** Mean COF of every pressure over cycles. */
export function meanCof({ tests, events }) {
  const rows = tests.flatMap((test) => test.fits.filter((fit) => fit.mean_cof !== null).map((fit) => [test.cycles, fit.pressure_bar, fit.mean_cof, fit.mean_cof_sd]));
  if (rows.length === 0) return { empty: "Mean COF is known from the first stationary test on." };
  const pressures = [...new Set(rows.map((row) => row[1]))].sort((a, b) => a - b);
  return {
    note: `Mean over the speeds of the first test, at ${pressures.length === 1 ? "one pressure" : `${pressures.length} pressures`}, with 90 % error bars.`,
    columns: [CYCLES, { name: "pressure, bar", text: (value) => fixed(value, 1) }, COF("mean COF"), { name: "standard deviation", text: (value) => fixed(value, 5) }],
    rows,
    figure: (c) => ({
      data: pressures.map((pressure, index) => {
        const own = rows.filter((row) => row[1] === pressure);
        const colour = c.ramp(pressures.length > 1 ? index / (pressures.length - 1) : 0);
        return {
          name: `${fixed(pressure, 1)} bar`, mode: "lines+markers", x: own.map((row) => row[0]), y: own.map((row) => row[2]), line: { color: colour, width: 1.4 }, marker: { color: colour, size: 5 },
          error_y: { type: "data", array: own.map((row) => 1.645 * row[3]), thickness: 1, width: 2, color: colour }, hovertemplate: `%{x:,.0f} cycles, ${fixed(pressure, 1)} bar<br>mean COF %{y:.4f}<extra></extra>`,
        };
      }),
      layout: { xaxis: { title: { text: "duty cycles" } }, yaxis: { title: { text: "mean COF" } }, ...eventMarks(events, c) },
    }),
  };
}
