// Stribeck curves: at one pressure by state (fig. 7b) or at one state by pressure (fig. 6a), and as isolines over pressure of one
// state (figs. 6b, 8) or of several (fig. 7a), or over cycles.

import { fixed } from "../shared/format.js";
import { named, pressureText, units } from "../shared/units.js";
import { distinct, recordColumns } from "./columns.js";
import { contoured, cutsOf } from "./contours.js";
import { pressureRampOf, rampOf } from "./palette.js";
import { curveOf, inUnit, measuredOf, xyOf } from "./stribeck_law.js";
import { planar } from "./traces.js";

/** @import { Surface } from "./contours.js" */
/** @import { CurvePoint } from "./stribeck_law.js" */

/** @typedef {{ tests: StribeckItem[], channels: Record<string, Channels>, clutch: ClutchOut, pressure?: number }} Answers channels by run */
/** @typedef {{ cycles: number, pressure: number, measured: CurvePoint[], fitted: CurvePoint[] }} Drawn */

/**
 * A few items spread evenly over all, the first and the last among them.
 * @template Item
 * @param {Item[]} items
 * @param {number} [most]
 */
export function spread(items, most = 6) {
  if (items.length <= most) return items;
  return Array.from({ length: most }, (_, index) => items[Math.round((index * (items.length - 1)) / (most - 1))]);
}

/**
 * The highest speed of the tests whose records have been read, rpm, and no less than 100.
 * @param {Record<string, Channels>} channels
 * @param {StribeckItem[]} tests
 */
const fastest = (channels, tests) =>
  tests.flatMap(({ run_id: id }) => channels[id]?.speed_rpm ?? []).reduce((most, speed) => Math.max(most, speed), 100);

/**
 * Some tests at some pressures: measured points where the channels have been read, the fit in any case.
 * @type {(answers: Answers, tests: StribeckItem[], wanted: (pressure: number) => boolean) => Drawn[]}
 */
function drawnOf({ channels, clutch, tests: known }, tests, wanted) {
  const end = fastest(channels, known);
  return tests.flatMap((test) =>
    test.fits
      .filter((fit) => wanted(fit.pressure_bar))
      .map((fit) => ({
        cycles: test.cycles,
        pressure: fit.pressure_bar,
        measured: inUnit(
          channels[test.run_id] ? measuredOf(channels[test.run_id], fit.pressure_bar) : [],
          fit.pressure_bar,
          clutch,
        ),
        fitted: inUnit(curveOf(fit, clutch, 0, end), fit.pressure_bar, clutch),
      })),
  );
}

/** @type {(drawn: Drawn[]) => Cell[][]} */
const rowsOf = (drawn) =>
  drawn.flatMap(({ cycles, pressure, measured, fitted }) => [
    ...measured.map((point) => ["measured", cycles, pressure, point.speed, point.torque]),
    ...fitted.map((point) => ["fit", cycles, pressure, point.speed, point.torque]),
  ]);

/**
 * Torque over speed: at one pressure, a colour a state, or of one state, a colour a pressure.
 * @param {Answers & { by: "state" | "pressure", run: string | undefined }} answers `by`: the colour; `run`: the state
 * @returns {Spec}
 */
export function flat(answers) {
  const { tests, by, pressure, run } = answers;
  const byState = by === "state";
  const chosen = byState ? spread(tests) : tests.filter((test) => test.run_id === run);
  const drawn = drawnOf(answers, chosen, (level) => !byState || level === pressure);
  if (drawn.length === 0) return { empty: "No stationary Stribeck test yet at this pressure." };
  const place = byState
    ? `At ${pressureText(pressure)}, from the first test to the last.`
    : `After ${fixed(drawn[0].cycles)} cycles, at every pressure.`;
  const few = `${drawn.length} of ${tests.length} tests are drawn; choose “Colour by pressure” to see any of them.`;
  /** @param {Drawn} curve */
  const label = (curve) => (byState ? `${fixed(curve.cycles)} cycles` : pressureText(curve.pressure));
  return {
    note: `${place} Points: measured. Lines: fitted.${byState && drawn.length < tests.length ? ` ${few}` : ""}`,
    columns: recordColumns(),
    rows: rowsOf(drawn),
    figure: planar({ title: "sliding speed, rpm", zero: true }, named(units().torque), [], (c) =>
      drawn.flatMap((curve, index) =>
        flatCurves(curve, label(curve), (byState ? rampOf : pressureRampOf)(c, index, drawn.length), c),
      ),
    ),
  };
}

/** @type {(run: Receipt, channels: Channels, clutch: ClutchOut) => Spec} the curves of one run */
export function curvesOfRun(run, channels, clutch) {
  const tests = [{ ...run, pressure_laws: null }];
  return flat({ tests, by: "pressure", run: run.run_id, channels: { [run.run_id]: channels }, clutch });
}

/** @type {(curve: Drawn, name: string, color: string, c: Colours) => Curve[]} */
const flatCurves = ({ measured, fitted }, name, color, c) => [
  { name, ...xyOf(fitted), line: { color } },
  { name, ...xyOf(measured), marker: { color: c.panel, size: 5, edge: { color, width: 1.4 } } },
];

/** @typedef {"pressure" | "states" | "cycles"} Depth what a surface is over: pressure of one state or of several, or cycles */

/**
 * The surface over speed and pressure of one state (figs. 6b, 8) or of several (fig. 7a), or of one pressure over speed and
 * cycles: isolines, and a cut.
 * @param {Answers & { over: Depth, run: string | undefined, cut: string | undefined }} answers `run`: the state
 * @returns {Spec}
 */
export function surface(answers) {
  const { tests, over, pressure, run, cut } = answers;
  const byPressure = over !== "cycles";
  const picked = {
    pressure: tests.filter((test) => test.run_id === run),
    states: spread(spread(tests), 4), // of those read for the curves as many as can be distinguished
    cycles: spread(tests, 9),
  };
  const drawn = drawnOf(answers, picked[over], (level) => byPressure || level === pressure);
  if (drawn.length < 2) {
    return { empty: `A surface needs ${byPressure ? "a test at two pressures" : "two tests"} or more.` };
  }
  const states = distinct(drawn.map(({ cycles }) => cycles));
  const after = `After ${states.map((cycles) => fixed(cycles)).join(", ")} cycles`;
  const place = byPressure ? after : `At ${pressureText(pressure)} over the life`;
  const several = over === "states" ? ", one colour per number of cycles" : "";
  const titles = {
    x: "speed, rpm",
    y: byPressure ? "pressure, bar" : "duty cycles",
    z: { title: named(units().torque) },
  };
  const surfaces = several
    ? states.map((at) =>
        surfaceOf(
          `${fixed(at)} cycles`,
          drawn.filter(({ cycles }) => cycles === at),
          byPressure,
        ),
      )
    : [surfaceOf("fit", drawn, byPressure)];
  const cuts = cutsOf(surfaces, titles, cut);
  return {
    note: `${place}: lines of equal torque as fitted${several}, and torque along the dashed cut.`,
    columns: recordColumns(),
    rows: rowsOf(drawn),
    cuts,
    figure: (c) => contoured(surfaces, titles, cuts, c),
  };
}

/** @type {(name: string, drawn: Drawn[], byPressure: boolean) => Surface} */
function surfaceOf(name, drawn, byPressure) {
  const own = drawn
    .map((curve) => ({ ...curve, y: byPressure ? curve.pressure : curve.cycles }))
    .sort((a, b) => a.y - b.y);
  return {
    name,
    points: "measured",
    x: xyOf(own[0].fitted).x,
    y: own.map(({ y }) => y),
    values: own.map(({ fitted }) => xyOf(fitted).y),
    measured: own.flatMap(({ measured, y }) => measured.map(({ speed, torque }) => ({ x: speed, y, z: torque }))),
  };
}
