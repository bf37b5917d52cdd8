// Mean COF, its law with the 90 % band, the threshold and when it is reached; behind it the earlier predictions.

import { cycles, estimate, fixed, interval, probability } from "../shared/format.js";
import { CYCLES, intervalColumns, KIND, measuredAndTracked } from "./columns.js";
import { faint } from "./palette.js";
import { band, eventMarks, measuredPoints } from "./traces.js";

/** @typedef {{ at: number, cof: number | null, remaining: SeriesItem }} Prediction made at `at` cycles, when mean COF was `cof` */

const COLUMNS = [KIND, CYCLES, ...intervalColumns("mean COF", 4)];

/**
 * @param {{ life: RemainingLife, pooled: DegradationItem | undefined, predictions: Prediction[], events: Receipt[] }} answers
 * @returns {Spec}
 */
export function fan({ life, pooled, predictions, events }) {
  if (!pooled) return { empty: "Mean COF is known from the first stationary test on." };
  const { measured, trajectory } = pooled;
  const threshold = life.criterion.threshold_mean_cof;
  const last = lastCycle(life, measured.cycles);
  return {
    note: noteOf(life),
    columns: COLUMNS,
    rows: [...measuredAndTracked(pooled, "measured"), ...endRows(life)],
    figure: (c) => [
      {
        x: { title: "duty cycles", range: [-0.01 * last, last] },
        y: { title: "mean COF" },
        curves: [
          ...past(predictions, threshold, c),
          ...law(trajectory, life, c),
          ...endOfLife(life, threshold, c),
          measuredPoints("measured", measured, { color: c.ink, size: 7 }),
        ],
        marks: [...eventMarks(events, c), ...thresholdMarks(threshold, c), ...safeBound(life, last, c)],
      },
    ],
  };
}

/** @param {RemainingLife} life */
function noteOf(life) {
  const { current, criterion, end_of_life_cycles: end } = life;
  if (life.status === "insufficient_data") {
    return `Three tests at different cycles are needed for a prediction: ${life.statement}.`;
  }
  const value = `Mean COF ${estimate(current.mean_cof, current.mean_cof_sd)}`;
  if (life.ended) return `${value}; the life was declared ended at ${fixed(life.ended.cycles)} cycles.`;
  const median = end["0.5"];
  const when =
    median === null
      ? `with a probability of ${probability(life.probability_of_reaching)} within ${fixed(life.horizon_cycles)} cycles`
      : `at about ${cycles(median, end["0.05"], end["0.95"])} cycles (90 %: ${interval(end)})`;
  const reaches = median !== null && life.status === "reached" ? "reached" : "reaches";
  if (criterion.threshold_mean_cof === null || criterion.fraction === null)
    return `${value}; no end-of-life criterion of the clutch uses mean COF.`;
  const limit = `${fixed(criterion.threshold_mean_cof, 4)}, ${fixed(100 * criterion.fraction)} % of new`;
  return `${value}; it ${reaches} ${limit}, ${when}.`;
}

/**
 * How far the abscissa goes: past the predicted end, but not so far that the measurements vanish.
 * @param {RemainingLife} life
 * @param {number[]} measured cycles of the tests
 */
function lastCycle(life, measured) {
  const past = Math.max(1, life.as_of_cycles ?? 0, ...measured);
  const end = life.end_of_life_cycles;
  const ahead = end["0.95"] ?? 1.5 * (end["0.5"] ?? past);
  return Math.max(1.08 * past, Math.min(1.06 * ahead, 4 * past));
}

/** @type {(life: RemainingLife) => Cell[][]} */
function endRows({ criterion: { threshold_mean_cof: threshold }, end_of_life_cycles: end }) {
  if (threshold === null) return [];
  const name = (/** @type {string} */ quantile) => `end of life, ${100 * Number(quantile)} %`;
  return Object.entries(end).map(([quantile, at]) => [name(quantile), at, threshold, null, null]);
}

/** @type {(y: number | null, c: Colours) => Mark[]} dashed, with its value */
const thresholdMarks = (y, c) =>
  y === null ? [] : [{ y, line: { color: c.failure, width: 1.6, dash: "dash" }, text: `threshold ${fixed(y, 4)}` }];

/**
 * Up to where the life lasts with 95 %: a line, where it is on the paper; `last`: cycles on the paper.
 * @type {(life: RemainingLife, last: number, c: Colours) => Mark[]}
 */
function safeBound({ at_least: left, as_of_cycles: now, status }, last, c) {
  const x = (now ?? 0) + (left ?? 0);
  if (left === null || left < 1 || x > last || status === "reached") return [];
  const text = `safe until ${cycles(x, 0, 1000)} (95 %)`;
  return [{ x, line: { color: c.normal, width: 2, dash: "dot" }, text }];
}

/**
 * Each earlier prediction as a line from mean COF when it was made to the predicted end of life.
 * @type {(predictions: Prediction[], threshold: number | null, c: Colours) => Curve[]}
 */
function past(predictions, threshold, c) {
  const lines = predictions.slice(0, -1).flatMap(({ at, cof, remaining: { value } }) => {
    return value !== null && value > 0 && cof !== null ? [{ at, cof, end: at + value }] : [];
  });
  if (threshold === null || lines.length === 0) return [];
  const x = lines.flatMap(({ at, end }) => [at, end, null]);
  const y = lines.flatMap(({ cof }) => [cof, threshold, null]);
  const line = { color: faint(c.quiet, 0.45), width: 1 };
  return [{ name: "earlier predictions", x, y, line, silent: true }];
}

/**
 * Eq. 6 with its band, led on to the threshold where the prediction reaches it past the law's last point: along its slope
 * there, which then flattens or steepens as a power of the way that is left.
 * @param {Trajectory} trajectory
 * @param {RemainingLife} life
 * @param {Colours} c
 * @returns {Curve[]}
 */
function law(trajectory, life, c) {
  const end = life.end_of_life_cycles;
  const threshold = life.criterion.threshold_mean_cof;
  const last = trajectory.cycles.at(-1) ?? 0;
  const median = end["0.5"];
  const beyond = life.status === "predicted" && median !== null && median > last;
  /** @type {(values: number[], at: number | null) => { x: number[], y: number[] }} */
  const joined = (values, at) => {
    const { cycles: x } = trajectory;
    const [before = 0, y = 0] = values.slice(-2);
    if (!beyond || threshold === null || at === null || at <= last || y <= threshold) return { x, y: values };
    const slope = (before - y) / (last - (x.at(-2) ?? 0));
    const power = slope > 0 ? (slope * (at - last)) / (y - threshold) : 1;
    const shares = Array.from({ length: 20 }, (_, index) => (index + 1) / 20);
    return {
      x: [...x, ...shares.map((share) => last + share * (at - last))],
      y: [...values, ...shares.map((share) => threshold + (y - threshold) * (1 - share) ** power)],
    };
  };
  return [
    band("its 90 % band", joined(trajectory.lower, end["0.05"]), joined(trajectory.upper, end["0.95"]), c),
    { name: "ageing as tracked", ...joined(trajectory.median, median), line: { color: c.accent, width: 2.2 } },
  ];
}

/** @type {(life: RemainingLife, threshold: number | null, c: Colours) => Curve[]} */
function endOfLife(life, threshold, c) {
  const q = life.end_of_life_cycles;
  const median = q["0.5"];
  if (threshold === null || median === null) return [];
  /** @type {(from: string, to: string, width: number, name?: string) => Curve} */
  const bar = (from, to, width, name) => ({
    name,
    x: [q[from], q[to] ?? 10 * median],
    y: [threshold, threshold],
    line: { color: c.worn, width },
    silent: true,
  });
  return [
    bar("0.05", "0.95", 5, "end of life, 90 % and 50 %"),
    bar("0.25", "0.75", 11),
    {
      x: [median],
      y: [threshold],
      marker: { color: c.panel, size: 9, edge: { color: c.worn, width: 3 } },
    },
  ];
}
