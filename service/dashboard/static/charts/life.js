// Remaining cycles as they were predicted at each test, and mean COF at every pressure.

import { counted } from "../shared/format.js";
import { column, CYCLES, distinct, intervalColumns, PRESSURE } from "./columns.js";
import { band, linesByPressure, planar } from "./traces.js";

/** @import { Prediction } from "./fan.js" */

/**
 * Remaining cycles as they were predicted at each test, against what is predicted now.
 * @type {(answers: { life: RemainingLife, predictions: Prediction[], events: Receipt[] }) => Spec}
 */
export function remainingCycles({ life, predictions, events }) {
  const made = predictions.flatMap(({ at, remaining: { value, lower, upper } }) => {
    return value === null ? [] : [{ at, value, lower, upper }];
  });
  if (made.length === 0) return { empty: "The remaining cycles are predicted from the third stationary test on." };
  const end = life.end_of_life_cycles["0.5"];
  // the scale is that of the later half: a first forecast that was far off leaves the paper and does not flatten the rest
  const later = made.slice(Math.floor(made.length / 2));
  const top =
    1.12 * Math.max(1, end ?? 0, ...later.map(({ value, upper }) => Math.min(upper ?? Infinity, 2.2 * value + 1)));
  const above = made.filter(({ value }) => value > top).length;
  const beyond = above > 0 && ` ${counted(above, "early prediction lies", "early predictions lie")} above the chart.`;
  const comparison =
    end === null
      ? ""
      : "A perfect prediction would lie on the dashed line. This line ends at the end of life as predicted today.";
  return {
    note: `The median and the 90 % interval as predicted at that time. ${comparison}${beyond || ""}`,
    columns: [CYCLES, ...intervalColumns("remaining cycles", 4)],
    rows: predictions.map(({ at, remaining: r }) => [at, r.value, r.lower, r.upper]),
    figure: planar("duty cycles at the prediction", { title: "remaining cycles", range: [0, top] }, events, (c) =>
      predictionTraces(made, end, top, c),
    ),
  };
}

/**
 * @param {{ at: number, value: number, lower: number | null, upper: number | null }[]} made
 * @param {number | null} end
 * @param {number} top
 * @param {Colours} c
 * @returns {Curve[]}
 */
function predictionTraces(made, end, top, c) {
  const x = made.map(({ at }) => at);
  const lower = made.map((prediction) => prediction.lower ?? 0);
  const upper = made.map((prediction) => Math.min(prediction.upper ?? Infinity, 4 * top));
  /** @type {Line} */
  const line = { color: c.worn, width: 1.6, dash: "dash" };
  return [
    band("90 % interval", { x, y: lower }, { x, y: upper }, c),
    ...(end === null ? [] : [{ name: "today's median", x: [0, end], y: [end, 0], line, silent: true }]),
    {
      name: "predicted median",
      x,
      y: made.map(({ value }) => value),
      line: { color: c.accent, width: 2 },
      marker: { color: c.accent },
    },
  ];
}

/** @type {(answers: { tests: StribeckItem[], events: Receipt[] }) => Spec} mean COF of every pressure over cycles */
export function meanCof({ tests, events }) {
  const values = tests.flatMap(({ cycles, fits }) => {
    return fits.flatMap(({ pressure_bar: pressure, mean_cof: value, mean_cof_sd: sd }) =>
      value === null ? [] : [{ cycles, pressure, value, sd }],
    );
  });
  if (values.length === 0) return { empty: "Mean COF is known from the first stationary test on." };
  const pressures = distinct(values.map(({ pressure }) => pressure));
  return {
    note: `Mean over the speeds of the first test, at ${counted(pressures.length, "pressure")}, with 90 % error bars.`,
    columns: [CYCLES, PRESSURE, column("mean COF", 4), column("standard deviation", 5)],
    rows: values.map(({ cycles, pressure, value, sd }) => [cycles, pressure, value, sd]),
    figure: planar("duty cycles", "mean COF", events, (c) => linesByPressure(values, 5, c)),
  };
}
