// @ts-check
// The charts' colours, taken from the style sheet, so that light and dark are defined in one place.

/** @import { ColourName, Colours, Scheme } from "./types.js" */

/** @type {ColourName[]} */
const NAMES = [
  "ink",
  "quiet",
  "line",
  "edge",
  "panel",
  "accent",
  "failure",
  "out",
  "check",
  "normal",
  "maintenance",
  "fresh",
  "midlife",
  "worn",
  "low",
  "high",
];

/**
 * The colours as they are now, or as they are in `scheme`.
 * @param {Scheme} [scheme]
 * @returns {Colours}
 */
export function colours(scheme = null) {
  const probe = document.createElement("span");
  probe.hidden = true;
  if (scheme) probe.style.colorScheme = scheme;
  document.body.append(probe);
  const computed = getComputedStyle(probe);
  const entries = NAMES.map((name) => {
    probe.style.color = `var(--${name})`;
    return [name, computed.color];
  });
  probe.remove();
  /** @type {Record<ColourName, string>} */
  const named = Object.fromEntries(entries);
  return {
    ...named,
    ramp: (share) => between([named.fresh, named.midlife, named.worn], share),
    pressureRamp: (share) => between([named.low, named.high], share),
  };
}

/**
 * Red, green and blue of a computed colour.
 * @param {string} rgb
 */
const channels = (rgb) => (rgb.match(/[\d.]+/g) ?? []).slice(0, 3).map(Number);

/**
 * A colour between several, share from 0 to 1.
 * @param {string[]} stops
 * @param {number} share
 */
function between(stops, share) {
  const place = Math.min(1, Math.max(0, share)) * (stops.length - 1);
  const index = Math.min(stops.length - 2, Math.floor(place));
  const [from, to] = [channels(stops[index]), channels(stops[index + 1])];
  return `rgb(${from.map((value, channel) => Math.round(value + (to[channel] - value) * (place - index))).join(", ")})`;
}

/**
 * The colour of the n-th of several things, from fresh to worn.
 * @param {Colours} c
 * @param {number} index
 * @param {number} count
 */
export const rampOf = (c, index, count) => c.ramp(count > 1 ? index / (count - 1) : 0);

/**
 * The colour of the n-th of several pressures, from the lowest to the highest.
 * @param {Colours} c
 * @param {number} index
 * @param {number} count
 */
export const pressureRampOf = (c, index, count) => c.pressureRamp(count > 1 ? index / (count - 1) : 0);

/**
 * The colour, partly transparent.
 * @param {string} rgb
 * @param {number} opacity
 */
export const faint = (rgb, opacity) => `rgba(${channels(rgb).join(", ")}, ${opacity})`;

/**
 * A colour scale from fresh to worn, for surfaces.
 * @param {Colours} c
 * @returns {[number, string][]}
 */
export const scaleOf = (c) => [
  [0, c.fresh],
  [0.5, c.midlife],
  [1, c.worn],
];
