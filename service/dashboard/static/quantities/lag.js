// The lag of friction behind its stationary curve over life: over cycles (figs. 15 to 17), and over pressure (figs. 13, 14).

import {
  CYCLES,
  digitsColumn,
  distinct,
  intervalColumns,
  KIND,
  levelsOf,
  measuredAndTracked,
  PRESSURE,
  withInterval,
} from "../charts/columns.js";
import { rampOf } from "../charts/palette.js";
import { spread } from "../charts/stribeck.js";
import { linesByPressure, measuredLine, planar, tracked } from "../charts/traces.js";
import { fixed } from "../shared/format.js";
import { pressureText } from "../shared/units.js";
import { QUANTITIES, titleOf } from "./names.js";

/** @typedef {"loop_area" | "attractor" | "film_time"} LagName */

/** @type {Record<LagName, string>} */
const MEANINGS = {
  loop_area: "Area of the loop over whole periods; positive where torque is higher while the speed rises",
  attractor: "How fast friction follows its stationary curve; a lower value means a longer lag",
  film_time: "The time constant of the squeezed film",
};

export const LAG_NAMES = /** @type {LagName[]} */ (Object.keys(MEANINGS));

/** @param {LagName} name */
function axisOf(name) {
  const title = titleOf(QUANTITIES[name]);
  return `${title.charAt(0).toLowerCase()}${title.slice(1)}`;
}

/** @type {(name: LagName) => Column[]} */
const columnsOf = (name) => [
  KIND,
  PRESSURE,
  digitsColumn("frequency, Hz", 3),
  CYCLES,
  ...intervalColumns(axisOf(name), 3),
];

/** @param {LagName} name */
const missing = (name) => `${QUANTITIES[name].title}: no dynamic Stribeck test determines it yet. ${MEANINGS[name]}.`;

/** @param {DegradationItem[]} items what was measured, by pressure */
const measuredOf = (items) =>
  levelsOf(items).flatMap((level) => {
    const own = items.filter((item) => item.pressure_bar === level);
    return own.flatMap(({ measured: { cycles, value, sd } }) =>
      cycles.map((at, index) => ({ cycles: at, pressure: level, value: value[index], sd: sd[index] })),
    );
  });

/**
 * A quantity of one frequency over cycles, a line a pressure; of one pressure its track with the band.
 * @param {{ items: DegradationItem[], name: LagName, pressure: number | undefined, events: Receipt[] }} answers
 * @returns {Spec}
 */
export function lagOverCycles({ items, name, pressure, events }) {
  if (items.length === 0) return { empty: missing(name) };
  const chosen = items.find((item) => item.pressure_bar === pressure);
  const course = chosen && chosen.trajectory.cycles.length > 0 ? chosen : undefined;
  const more = course
    ? `Tracked with its 90 % band at ${fixed(pressure, 1)} bar.`
    : "From the third dynamic test on it is tracked.";
  return {
    note: `${MEANINGS[name]}; at ${items[0].frequency_hz} Hz, with 90 % error bars. ${more}`,
    columns: columnsOf(name),
    rows: items.flatMap((item) => measuredAndTracked(item, "measured", item.pressure_bar, item.frequency_hz)),
    figure: planar("duty cycles", axisOf(name), events, (c) => [
      ...(course ? track(course, c) : []),
      ...linesByPressure(measuredOf(items), 7, c),
    ]),
  };
}

/** @type {(item: DegradationItem, c: Colours) => Curve[]} */
const track = ({ pressure_bar: level, trajectory }, c) =>
  tracked(
    trajectory,
    { name: `tracked, ${pressureText(level)}`, line: { color: c.accent, width: 2.2, dash: "dash" } },
    c,
  );

/** @type {(answers: { items: DegradationItem[], name: LagName }) => Spec} a line a number of cycles */
export function lagOverPressure({ items, name }) {
  const values = measuredOf(items);
  if (values.length === 0) return { empty: missing(name) };
  const { title } = QUANTITIES[name];
  const states = distinct(values.map(({ cycles }) => cycles));
  const drawn = spread(states);
  return {
    note: `${title} at ${items[0].frequency_hz} Hz, from the first dynamic test to the last, with 90 % error bars.`,
    columns: columnsOf(name),
    rows: values.map(({ cycles, pressure, value, sd }) => {
      return ["measured", pressure, items[0].frequency_hz, cycles, ...withInterval(value, sd)];
    }),
    figure: planar("pressure, bar", axisOf(name), [], (c) =>
      drawn.map((state, index) => {
        const label = `${fixed(state)} cycles`;
        const own = values.filter(({ cycles }) => cycles === state);
        const points = own.map(({ pressure, value, sd }) => ({ x: pressure, value, sd }));
        return measuredLine(label, points, { size: 7, color: rampOf(c, index, drawn.length) });
      }),
    ),
  };
}
