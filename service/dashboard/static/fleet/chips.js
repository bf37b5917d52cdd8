// @ts-check
// The chips above the table: how many clutches are in each state, and which of them are shown.

import { byId, h } from "../shared/dom.js";
import { stateIcon, STATES } from "../shared/state.js";

/** @import { StateName } from "../shared/state.js" */
/** @import { FleetTotals } from "../shared/types.js" */

/** @typedef {StateName | "held" | null} Choice a state, clutches with runs that are held, or all */

/** @type {(totals: FleetTotals, only: Choice) => number} how many clutches a choice shows */
export function countOf({ all, held, states }, only) {
  return only === null ? all : only === "held" ? held : states[only];
}

/** @param {string | undefined} name of a choice */
const chipOf = (name) => byId("chips").querySelector(`[data-state="${name}"]`);

/**
 * @param {FleetTotals} totals
 * @param {Choice} only what is shown
 * @param {(chosen: Choice) => void} choose
 */
export function drawChips(totals, only, choose) {
  /** @type {(name: Choice, label: string) => HTMLElement | null} */
  const chip = (name, label) => {
    const count = countOf(totals, name);
    if (count === 0 && name !== null && name !== only) return null;
    const pressed = String(only === name);
    const attributes = { type: "button", class: "chip", "data-state": name ?? "all", "aria-pressed": pressed };
    const icon = name && name !== "held" && stateIcon(name);
    return h("button", { ...attributes, onclick: () => choose(name) }, icon, h("b", {}, String(count)), ` ${label}`);
  };
  const focused = document.activeElement instanceof HTMLElement ? document.activeElement.dataset.state : undefined;
  const names = /** @type {StateName[]} */ (Object.keys(STATES));
  const chips = [
    chip(null, totals.all === 1 ? "clutch" : "clutches"),
    ...names.map((name) => chip(name, STATES[name].word.toLowerCase())),
    chip("held", "with held runs"),
  ];
  byId("chips").replaceChildren(...chips.filter((element) => element !== null));
  const again = focused && chipOf(focused);
  if (again instanceof HTMLElement) again.focus();
}
