// The state of a clutch, after NAMUR NE 107, as the service says it: one of five, each with its own word, shape and colour.

import { svg } from "./dom.js";
import { counted } from "./format.js";

/** @typedef {ClutchState["name"]} StateName */

/** @type {Record<StateName, string>} in words, the worst first */
export const STATES = {
  failure: "Failure",
  maintenance: "Maintenance required",
  check: "Function check",
  out_of_specification: "Out of specification",
  normal: "Normal",
};

/** @type {(name: StateName) => Record<string, string>} a state's colour, which the style sheet has under its name */
export const colourOf = (name) => ({ color: `var(--${name})` });

/** @type {(count: number) => string} how many runs of a clutch wait for someone to look at them */
export const heldText = (count) => `${counted(count, "run")} held`;

const CIRCLE = "M10 1a9 9 0 1 1 0 18a9 9 0 1 1 0-18z";
const SQUARE = "M4.5 1.5h11a3 3 0 0 1 3 3v11a3 3 0 0 1-3 3h-11a3 3 0 0 1-3-3v-11a3 3 0 0 1 3-3z";
/** @type {Record<StateName, [outline: string, mark: string]>} */
const SHAPES = {
  failure: [CIRCLE, "M6.5 6.5l7 7m0-7l-7 7"],
  out_of_specification: ["M10 1.2l9 16.3H1z", "M10 7v5.2m0 2v1.4"],
  maintenance: ["M10 .8L19.2 10 10 19.2.8 10z", "M10 5.5V11m0 2.2v1.5"],
  check: [SQUARE, "M7 7.8a3 3 0 1 1 4.4 2.6c-1 .5-1.4 1-1.4 2m0 2v.4"],
  normal: [CIRCLE, "M5.8 10.3l2.9 2.9 5.5-6"],
};

/**
 * The state's shape; its word is beside it, so screen readers skip the shape.
 * @param {StateName} name
 */
export function stateIcon(name) {
  return svg(
    "svg",
    { class: "icon", style: colourOf(name), viewBox: "0 0 20 20", width: 20, height: 20, "aria-hidden": "true" },
    svg("path", { d: SHAPES[name][0] }),
    svg("path.mark", { d: SHAPES[name][1] }),
  );
}
