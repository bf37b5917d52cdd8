// Friction loops before the stationary curve of the same state (fig. 12): by state at one pressure (fig. 15), by pressure at
// one state (fig. 13).

import { fixed } from "../shared/format.js";
import { named, pressureText, units } from "../shared/units.js";
import { recordColumns } from "./columns.js";
import { pressureRampOf, rampOf } from "./palette.js";
import { curveOf, inUnit, measuredOf, xyOf } from "./stribeck_law.js";
import { planar } from "./traces.js";

/** @import { Answers } from "./stribeck.js" */
/** @import { CurvePoint } from "./stribeck_law.js" */

/** Most points of a loop that are drawn, and bar about a level that still belong to it: between two levels torque is of neither. */
const LOOP = { most: 1500, gap: 0.1 };

const NO_LOOPS =
  "No dynamic Stribeck test yet. Send one as kind dynamic_stribeck: speed swept to and fro at constant pressure, sampled.";

/**
 * The stationary curve of the state that a loop is of: of the test at the same cycles and pressure; empty where there is none.
 * @param {LoopItem} loop
 * @param {CurvePoint[]} trace
 * @param {StribeckItem[]} tests
 * @param {ClutchOut} clutch
 * @returns {CurvePoint[]}
 */
function stationaryOf({ cycles, pressure_bar: pressure }, trace, tests, clutch) {
  const fits = tests.filter((test) => test.cycles === cycles).flatMap((test) => test.fits);
  const fit = fits.find(({ pressure_bar: level }) => Math.abs(level - pressure) <= LOOP.gap);
  const fastest = trace.reduce((most, { speed }) => Math.max(most, speed), 0);
  return inUnit(fit ? curveOf(fit, clutch, 0, fastest) : [], pressure, clutch);
}

/** @type {Record<string, string>} */
const DIRECTIONS = {
  higher_accelerating: "higher in acceleration",
  higher_decelerating: "higher in deceleration",
  none: "the same either way, within noise",
};

/** @param {LoopItem} loop */
function lagText({ direction, better_law: law }) {
  const better = law === null ? "neither model of the lag fits clearly better" : `the ${law} fits better`;
  return `torque is ${DIRECTIONS[direction] ?? direction}, ${better}`;
}

/** @type {(loops: LoopItem[], label: (loop: LoopItem) => string) => string} loops of one kind named together */
function lagNote(loops, label) {
  const kinds = [...new Set(loops.map(lagText))];
  if (kinds.length === 1) return `In each loop ${kinds[0]}.`;
  /** @param {string} kind */
  const names = (kind) => loops.filter((loop) => lagText(loop) === kind).map(label);
  return kinds.map((kind) => `${names(kind).join(", ")}: ${kind}.`).join(" ");
}

/**
 * Torque over speed of some loops, and behind each the stationary curve; `over` says whether the colour is the state or the
 * pressure.
 * @param {Answers & { loops: LoopItem[], over: "state" | "pressure", run: string | undefined }} choices `pressure` where the
 *   colour is the state, `run` where it is the pressure
 * @returns {Spec}
 */
export function loopCurves({ loops, tests, clutch, channels, over, pressure, run }) {
  const byState = over === "state";
  /** @param {LoopItem} loop */
  const traceOf = ({ run_id: id, pressure_bar: level }) => inUnit(measuredOf(channels[id], level, LOOP), level, clutch);
  const drawn = loops
    .filter((loop) => channels[loop.run_id] && (byState ? loop.pressure_bar === pressure : loop.run_id === run))
    .map((loop) => ({ loop, trace: traceOf(loop) }))
    .filter(({ trace }) => trace.length > 2)
    .map(({ loop, trace }) => ({ loop, trace, stationary: stationaryOf(loop, trace, tests, clutch) }));
  if (drawn.length === 0) return { empty: NO_LOOPS };
  /** @param {LoopItem} loop */
  const label = (loop) => (byState ? `${fixed(loop.cycles)} cycles` : pressureText(loop.pressure_bar));
  const place = byState
    ? `At ${pressureText(pressure)}, from the first dynamic test to the last.`
    : `After ${fixed(drawn[0].loop.cycles)} cycles, at every pressure.`;
  return {
    note: `${place} Dashed: the stationary curve at the same number of cycles. ${lagNote(
      drawn.map(({ loop }) => loop),
      label,
    )}`,
    columns: recordColumns(),
    rows: drawn.flatMap(({ loop: { cycles, pressure_bar: level }, trace, stationary }) => [
      ...trace.map(({ speed, torque }) => ["loop", cycles, level, speed, torque]),
      ...stationary.map(({ speed, torque }) => ["stationary curve", cycles, level, speed, torque]),
    ]),
    figure: planar("sliding speed, rpm", named(units().torque), [], (c) => {
      const colors = drawn.map((_, index) => (byState ? rampOf : pressureRampOf)(c, index, drawn.length));
      const lines = drawn.map(({ loop, trace }, index) => {
        return { name: label(loop), ...xyOf(trace), line: { color: colors[index], width: 1.3 } };
      });
      return [...stationaryTraces(drawn, colors), ...lines];
    }),
  };
}

/** @type {(drawn: { stationary: CurvePoint[] }[], colors: string[]) => Curve[]} */
const stationaryTraces = (drawn, colors) =>
  drawn.flatMap(({ stationary }, index) =>
    stationary.length === 0
      ? []
      : [{ name: "stationary curve", ...xyOf(stationary), line: { color: colors[index], width: 2, dash: "dash" } }],
  );
