// The charts' colours, taken from the style sheet, so that light and dark are defined in one place.

export const NAMES = /** @type {const} */ ([
  "ink",
  "quiet",
  "line",
  "edge",
  "panel",
  "accent",
  "failure",
  "check",
  "normal",
  "maintenance",
  "fresh",
  "midlife",
  "worn",
  "low",
  "high",
]);

/** @type {(scheme?: Scheme) => Colours} the colours as they are now, or as they are in `scheme` */
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
  return /** @type {Colours} */ (Object.fromEntries(entries));
}

/** @type {(rgb: string) => number[]} red, green and blue of a computed colour */
const channels = (rgb) => (rgb.match(/[\d.]+/g) ?? []).slice(0, 3).map(Number);

/** @type {(stops: string[], share: number) => string} between the first colour, 0, and the last, 1 */
export function blend(stops, share) {
  const place = Math.min(1, Math.max(0, share)) * (stops.length - 1);
  const index = Math.min(stops.length - 2, Math.floor(place));
  const [from, to] = [channels(stops[index]), channels(stops[index + 1])];
  return `rgb(${from.map((value, channel) => Math.round(value + (to[channel] - value) * (place - index))).join(", ")})`;
}

/** @type {(index: number, count: number) => number} */
const shareOf = (index, count) => (count > 1 ? index / (count - 1) : 0);

/** @type {(c: Colours, index: number, count: number) => string} of the n-th of several, from fresh to worn */
export const rampOf = (c, index, count) => blend([c.fresh, c.midlife, c.worn], shareOf(index, count));

/** @type {(c: Colours, index: number, count: number) => string} from the lowest pressure to the highest */
export const pressureRampOf = (c, index, count) => blend([c.low, c.high], shareOf(index, count));

/** @type {(rgb: string, opacity: number) => string} the colour, partly transparent */
export const faint = (rgb, opacity) => `rgba(${channels(rgb).join(", ")}, ${opacity})`;
