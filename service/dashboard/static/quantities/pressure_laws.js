// A Stribeck parameter of one test over pressure, its law (fig. 9) and how far the test determines it.

import { HALF_OF_90, intervalColumns, KIND, PRESSURE, withInterval } from "../charts/columns.js";
import { axisOf } from "../charts/parameters.js";
import { measuredPoints, planar, tracked } from "../charts/traces.js";
import { fixed } from "../shared/format.js";

/** @import { ParameterName } from "../charts/parameters.js" */

const POINTS = 60;

const COLUMNS = [KIND, PRESSURE, ...intervalColumns("value", 4)];

/**
 * A law's value at a pressure, bar, and its standard deviation: gᵀ Σ g with the derivatives g by its coefficients.
 * @param {LinearLaw | AsymptoticLaw} law
 * @param {number} pressure
 */
export function lawAt(law, pressure) {
  let value;
  let gradient;
  if ("decay_bar" in law) {
    const share = Math.exp(-pressure / law.decay_bar);
    value = law.asymptote + law.excess * share;
    gradient = [1, share, (law.excess * share * pressure) / law.decay_bar ** 2];
  } else {
    value = law.intercept + law.slope_per_bar * pressure;
    gradient = [1, pressure];
  }
  const variance = gradient.reduce(
    (sum, slope, row) => sum + gradient.reduce((part, other, at) => part + slope * law.covariance[row][at] * other, 0),
    0,
  );
  return { pressure, value, sd: Math.sqrt(Math.max(0, variance)) };
}

/** @type {(answers: { test: StribeckItem | undefined, name: ParameterName }) => Spec} */
export function pressureLaw({ test, name }) {
  const points = (test?.fits ?? [])
    .filter((fit) => !fit.undetermined.includes(name))
    .map((fit) => ({ pressure: fit.pressure_bar, value: fit.parameters[name], sd: fit.standard_errors[name] }))
    .sort((a, b) => a.pressure - b.pressure);
  const law = test?.pressure_laws?.[name];
  if (test === undefined || points.length === 0 || !law) {
    return { empty: "A pressure law needs a stationary test at three pressures or more." };
  }
  const [from, to] = [points[0].pressure, points[points.length - 1].pressure];
  const curve = Array.from({ length: POINTS }, (_, index) => lawAt(law, from + ((to - from) * index) / (POINTS - 1)));
  const shape = "decay_bar" in law ? "falls to an asymptote" : "is a straight line";
  /** @type {(kind: string, drawn: typeof points) => Cell[][]} */
  const rowsOf = (kind, drawn) => drawn.map(({ pressure, value, sd }) => [kind, pressure, ...withInterval(value, sd)]);
  const edge = (/** @type {number} */ sign) => curve.map(({ value, sd }) => value + sign * HALF_OF_90 * sd);
  const course = { cycles: curve.map(({ pressure }) => pressure), lower: edge(-1), median: edge(0), upper: edge(1) };
  const identified = {
    cycles: points.map(({ pressure }) => pressure),
    value: points.map(({ value }) => value),
    sd: points.map(({ sd }) => sd),
  };
  return {
    note: `After ${fixed(test.cycles)} cycles. Points: identified at each pressure, with 90 % error bars. The law ${shape}; the band around it holds 90 %.`,
    columns: COLUMNS,
    rows: [...rowsOf("identified", points), ...rowsOf("law", curve)],
    figure: planar("pressure, bar", axisOf(name), [], (c) => [
      ...tracked(course, { name: "law", line: { color: c.accent } }, c),
      measuredPoints("identified", identified, { color: c.ink }),
    ]),
  };
}
