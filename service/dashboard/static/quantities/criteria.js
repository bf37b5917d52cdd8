// Quantities that are tracked and may end a life: answers of the API go in, charts and tables come out. Open this file first (what
// ends a life: its criteria, when each is reached, and how probably it is the first), then shudder.js, lag.js and pressure_laws.js;
// lazy.js reads an answer that takes seconds when its chart is looked at, and again only when the clutch has changed.

import { h, scrolling, table } from "../shared/dom.js";
import { fixed, interval, median, percent, probability, significant, withSd } from "../shared/format.js";
import { pressureText } from "../shared/units.js";
import { QUANTITIES } from "./names.js";

/** What is known of one criterion by itself: the columns of `criterionRow`. */
export const OWN_COLUMNS = [
  "Criterion",
  "Now",
  "Limit",
  "Reached at, cycles",
  "90 % interval",
  "Probability of reaching it",
];
const COLUMNS = [...OWN_COLUMNS, "Probability of being the first"];

/** @type {(criterion: CriterionIn) => string} a quantity and where it is measured */
export function placeText({ quantity, pressure_bar: pressure, speed_rpm: speed, frequency_hz: frequency }) {
  const at = [
    speed === null ? [] : `${fixed(speed)} rpm`,
    frequency === null ? [] : `${significant(frequency, 2)} Hz`,
    pressure === null ? [] : pressureText(pressure),
  ].flat();
  return [QUANTITIES[quantity].title, ...at].join(", ");
}

/** @type {(criterion: CriterionIn) => string} the limit of a criterion in words */
export function limitText({ quantity, fraction, below, above }) {
  const { unit } = QUANTITIES[quantity];
  if (fraction !== null) return `${percent(fraction)} of new`;
  const [word, value] = below === null ? ["above", above] : ["below", below];
  return `${word} ${significant(value, 3)}${unit && ` ${unit}`}`;
}

/** @type {(criterion: CriterionOutcome) => string} when a limit is reached, as part of a sentence */
export function reachedText({
  limit,
  end_of_life_cycles: end,
  remaining_cycles: left,
  probability_of_reaching: chance,
}) {
  const level = `the limit ${significant(limit, 3)}`;
  if (chance === null) return "too few tests to predict when it is reached";
  const reaches = `it is reached with a probability of ${probability(chance)}`;
  if (end["0.95"] === 0) return `${level} was already passed when new`;
  if (end["0.5"] === null) return `${level} may never be reached: ${reaches}`;
  const at = `reached at about ${median(end)} cycles (90 %: ${interval(end)})`;
  return left["0.5"] === 0 ? `${level} has been ${at}` : `${level} is ${at}, ${median(left)} cycles from now`;
}

/** @type {(criterion: CriterionOutcome) => string[]} what is known of a criterion by itself */
export function criterionRow(criterion) {
  const { current, end_of_life_cycles: end } = criterion;
  const { unit } = QUANTITIES[criterion.quantity];
  return [
    placeText(criterion),
    `${withSd(current.value, current.sd)}${unit && ` ${unit}`}`,
    limitText(criterion),
    median(end),
    interval(end),
    probability(criterion.probability_of_reaching),
  ];
}

/** @param {RemainingLife} life */
export const predicts = ({ status }) => status === "predicted" || status === "may_never_reach";

/**
 * What ends the life first: one criterion as a line, several as a table, the most probable first.
 * @param {RemainingLife} life
 */
export function criteriaTable({ criteria }) {
  if (criteria.length === 0) return [];
  if (criteria.length === 1) {
    const [only] = criteria;
    return [h("p.limits", h("b", "What limits first: "), `${placeText(only)}, ${limitText(only)}.`)];
  }
  const ordered = [...criteria].sort((a, b) => b.probability_first - a.probability_first);
  const rows = ordered.map((criterion) => [...criterionRow(criterion), probability(criterion.probability_first)]);
  const caption = scrolling("What limits first", table("What limits first", COLUMNS, rows));
  return [h("div.panel.limits", h("h3", "What limits first"), caption)];
}

/**
 * The remaining life by mean COF over all pressures alone, whatever else ends it: what the charts of mean COF show.
 * @type {(life: RemainingLife) => RemainingLife}
 */
export function byMeanCof(life) {
  const { criteria, criterion } = life;
  if (criteria.length === 0) return life;
  const own = criteria.find(({ quantity, pressure_bar: level }) => quantity === "mean_cof" && level === null);
  if (own) {
    const { fraction, limit, probability_of_reaching, end_of_life_cycles, remaining_cycles } = own;
    const place = { ...criterion, fraction, threshold_mean_cof: limit };
    const ahead = remaining_cycles["0.5"] === 0 ? "reached" : "predicted";
    const status = probability_of_reaching === null ? "insufficient_data" : ahead;
    return { ...life, status, criterion: place, probability_of_reaching, end_of_life_cycles, remaining_cycles };
  }
  const never = Object.fromEntries(Object.keys(life.end_of_life_cycles).map((level) => [level, null]));
  const place = { ...criterion, fraction: null, threshold_mean_cof: null };
  return { ...life, criterion: place, end_of_life_cycles: never, remaining_cycles: never };
}
