// @ts-check
// What a rule watches: its quantities with the side of their limit, and a rule as part of a sentence.

import { fixed, percent, significant, words } from "../shared/format.js";

/** @import { AlarmOut } from "../shared/types.js" */

/** @typedef {AlarmOut["quantity"]} Watched */

/** @type {Record<Watched, { title: string, side: "below" | "above" | null, unit: string, limit: string }>} */
export const WATCHED = {
  remaining_cycles: { title: "Remaining cycles, safe bound", side: "below", unit: "cycles", limit: "4000" },
  remaining_days: { title: "Remaining days at this pace", side: "below", unit: "days", limit: "14" },
  health: { title: "Health", side: "below", unit: "", limit: "0.2" },
  shudder_margin: { title: "Shudder margin dμ/dv", side: "below", unit: "s/m", limit: "0" },
  held_runs: { title: "Held runs", side: "above", unit: "", limit: "0" },
  off_course: { title: "A test that does not fit the earlier ones", side: null, unit: "", limit: "" },
  verdict: { title: "A new verdict: data and model disagree", side: null, unit: "", limit: "" },
  state: { title: "Any state but normal", side: null, unit: "", limit: "" },
  silent_hours: { title: "Hours since the last run", side: "above", unit: "h", limit: "24" },
};

/**
 * When a rule raises an alarm.
 * @param {AlarmOut} rule
 */
export function ruleText({ quantity, below, above, probability, any_of: names }) {
  const { title, side, unit } = WATCHED[quantity];
  if (side === null) return names ? `${title} (${names.map((name) => words(name).toLowerCase()).join(", ")})` : title;
  const limit = below ?? above ?? 0;
  const value = Math.abs(limit) >= 100 ? fixed(limit) : significant(limit, 3);
  const sure = probability === 0.05 ? "" : `, ${percent(probability)} quantile`;
  return `${title} ${side} ${value}${unit && ` ${unit}`}${sure}`;
}
