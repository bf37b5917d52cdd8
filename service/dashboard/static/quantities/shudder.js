// The shudder margin: the slope dμ/dv of the fitted curves over cycles. Below zero friction falls with speed.

import { column, CYCLES, intervalColumns, KIND, measuredAndTracked, PRESSURE } from "../charts/columns.js";
import { measuredPoints, planar, tracked } from "../charts/traces.js";
import { fixed } from "../shared/format.js";
import { pressureText } from "../shared/units.js";
import { reachedText } from "./criteria.js";

const COLUMNS = [KIND, PRESSURE, column("speed, rpm"), CYCLES, ...intervalColumns("dμ/dv, s/m", 3)];

const NO_SLOPES = "The slope needs a stationary test whose curves determine all four parameters.";

/** Beside a limit that no criterion of the clutch has: its state and what limits it first do not follow from it. */
const NO_CRITERION = "No criterion of this clutch: it does not end its life and does not count for its state.";

/**
 * The slopes at one pressure, a colour a speed.
 * @param {{ items: DegradationItem[], limits: CriterionOutcome[] | null, counts: boolean, events: Receipt[] }} answers
 *   `limits`: when slopes there reach their limit; null while it is computed; `counts`: whether that ends the clutch's life
 * @returns {Spec}
 */
export function shudderMargin({ items, limits, counts, events }) {
  if (items.length === 0) return { empty: NO_SLOPES };
  const found = (limits ?? []).map(limitText);
  const when =
    limits === null ? "Computing when the slope reaches 0 …" : [...found, counts ? "" : NO_CRITERION].join(" ");
  return {
    note: `At ${pressureText(items[0].pressure_bar)}. Below the dashed line friction falls with speed, and the driveline may shudder. ${when}`,
    columns: COLUMNS,
    rows: items.flatMap((item) => measuredAndTracked(item, "measured", item.pressure_bar, item.speed_rpm)),
    figure: planar("duty cycles", "dμ/dv, s/m", events, (c) => [
      ...items.flatMap((item, index) => slopeTraces(item, [c.accent, c.check, c.normal][index % 3], c)),
      zeroLine(items, c),
    ]),
  };
}

/** @param {CriterionOutcome} limit */
const limitText = (limit) => `At ${fixed(limit.speed_rpm)} rpm ${reachedText(limit)}.`;

/** @type {(item: DegradationItem, color: string, c: Colours) => Curve[]} */
function slopeTraces({ speed_rpm: speed, measured, trajectory }, color, c) {
  const name = `${fixed(speed)} rpm`;
  return [...tracked(trajectory, { name, band: "", line: { color } }, c), measuredPoints(name, measured, { color })];
}

/** @type {(items: DegradationItem[], c: Colours) => Curve} */
function zeroLine(items, c) {
  const last = Math.max(1, ...items.flatMap(({ measured, trajectory }) => [...measured.cycles, ...trajectory.cycles]));
  return { name: "no margin", x: [0, last], y: [0, 0], line: { color: c.ink, width: 1.6, dash: "dash" }, silent: true };
}
