// The state of a clutch, after NAMUR NE 107, as the service says it: one of five, each with its own word, shape and colour.

import { svg } from "./dom.js";

/** @typedef {ClutchState["name"]} StateName */

/** @type {Record<StateName, { order: number, word: string }>} */
export const STATES = {
  failure: { order: 0, word: "Failure" },
  maintenance: { order: 1, word: "Maintenance required" },
  check: { order: 2, word: "Function check" },
  out_of_specification: { order: 3, word: "Out of specification" },
  normal: { order: 4, word: "Normal" },
};

/** @type {Record<string, string>} */
export const VERDICTS = {
  model_adequate: "Model adequate",
  cause_named: "Cause named",
  cause_ambiguous: "Cause ambiguous",
  unexplained_structure: "Unexplained structure",
  insufficient_data: "Too little data",
};

/** @type {(name: StateName) => Record<string, string>} a state's colour, which the style sheet has under its name */
export const colourOf = (name) => ({ color: `var(--${name})` });

/** @type {(count: number) => string} how many runs of a clutch wait for someone to look at them */
export const heldText = (count) => `${count} ${count === 1 ? "run" : "runs"} held`;

/** @type {Record<StateName, ["circle" | "path" | "rect", Record<string, string | number>][]>} */
const SHAPES = {
  failure: [
    ["circle", { cx: 10, cy: 10, r: 9 }],
    ["path", { d: "M6.5 6.5l7 7m0-7l-7 7", class: "mark" }],
  ],
  out_of_specification: [
    ["path", { d: "M10 1.2l9 16.3H1z" }],
    ["path", { d: "M10 7v5.2m0 2v1.4", class: "mark" }],
  ],
  maintenance: [
    ["path", { d: "M10 .8L19.2 10 10 19.2.8 10z" }],
    ["path", { d: "M10 5.5V11m0 2.2v1.5", class: "mark" }],
  ],
  check: [
    ["rect", { x: 1.5, y: 1.5, width: 17, height: 17, rx: 3 }],
    ["path", { d: "M7 7.8a3 3 0 1 1 4.4 2.6c-1 .5-1.4 1-1.4 2m0 2v.4", class: "mark" }],
  ],
  normal: [
    ["circle", { cx: 10, cy: 10, r: 9 }],
    ["path", { d: "M5.8 10.3l2.9 2.9 5.5-6", class: "mark" }],
  ],
};

/**
 * The state's shape; its word is beside it, so screen readers skip the shape.
 * @param {StateName} name
 */
export function stateIcon(name) {
  return svg(
    "svg",
    { class: "icon", style: colourOf(name), viewBox: "0 0 20 20", width: 20, height: 20, "aria-hidden": "true" },
    SHAPES[name].map(([shape, attributes]) => svg(shape, attributes)),
  );
}
