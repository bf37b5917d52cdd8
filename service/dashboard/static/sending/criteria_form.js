// The criteria that end a clutch's life, as rows of a form: a quantity, where it is measured, its limit.

import { optionsOf, QUANTITIES } from "../quantities/names.js";
import { button, h, numberInput, quiet, select } from "../shared/dom.js";

/** @type {[string, string][]} */
const LIMITS = [
  ["fraction", "share of new"],
  ["below", "below"],
  ["above", "above"],
];
const PLACES = /** @type {const} */ ({ pressure_bar: "bar", speed_rpm: "rpm", frequency_hz: "Hz" });
const NAMES = optionsOf(QUANTITIES);

/**
 * The rows, and what they say.
 * @param {Partial<CriterionIn>[]} criteria at first
 * @returns {{ element: HTMLElement, value: () => object[] }}
 */
export function criteriaForm(criteria) {
  /** @type {Map<HTMLElement, () => object>} */
  const rows = new Map();
  const list = h("div");
  /** @param {Record<string, any>} criterion */
  const add = (criterion) => {
    const quantity = select({ "aria-label": "Quantity" }, NAMES, criterion.quantity);
    const side = LIMITS.find(([name]) => typeof criterion[name] === "number")?.[0];
    const limit = select({ "aria-label": "Kind of limit" }, LIMITS, side);
    const value = numberInput({
      size: 6,
      required: true,
      "aria-label": "Limit",
      value: side === undefined ? "" : criterion[side],
    });
    const places = Object.entries(PLACES).map(([name, unit]) => {
      const at = criterion[name] ?? "";
      return { name, input: numberInput({ size: 6, placeholder: unit, "aria-label": unit, value: at }) };
    });
    const remove = () => {
      rows.delete(row);
      row.remove();
    };
    const inputs = places.map(({ input }) => input);
    const row = h("div.row.criterion", quantity, inputs, limit, value, button("Remove", remove, { class: "small" }));
    rows.set(row, () => {
      const measured = places.filter(({ input }) => input.value !== "");
      return {
        quantity: quantity.value,
        ...Object.fromEntries(measured.map(({ name, input }) => [name, Number(input.value)])),
        [limit.value]: Number(value.value),
      };
    });
    list.append(row);
  };
  for (const criterion of criteria) add(criterion);
  const more = button("Add a criterion", () => add({ quantity: "slope", below: 0, speed_rpm: 100 }), {
    class: "small",
  });
  const about = quiet(
    "Limits in place of that share; the first that is reached ends the life. Where one is measured: bar, rpm, Hz.",
  );
  return { element: h("div.criteria", about, list, more), value: () => [...rows.values()].map((of) => of()) };
}
