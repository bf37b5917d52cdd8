// The charts' colours, taken from the style sheet, so that light and dark are told in one place.

const NAMES = ["ink", "quiet", "line", "edge", "panel", "accent", "failure", "out", "check", "normal", "maintenance", "fresh", "midlife", "worn"];

/** The colours as they are now, or as they are in `scheme`. */
export function colours(scheme = null) {
  const probe = document.createElement("span");
  probe.hidden = true;
  if (scheme) probe.style.colorScheme = scheme;
  document.body.append(probe);
  const found = {};
  for (const name of NAMES) {
    probe.style.color = `var(--${name})`;
    found[name] = getComputedStyle(probe).color;
  }
  probe.remove();
  return { ...found, ramp: (share) => between([found.fresh, found.midlife, found.worn], share) };
}

const channels = (rgb) => rgb.match(/[\d.]+/g).slice(0, 3).map(Number);

/** A colour between several, share from 0 to 1. */
function between(stops, share) {
  const place = Math.min(1, Math.max(0, share)) * (stops.length - 1);
  const index = Math.min(stops.length - 2, Math.floor(place));
  const [from, to] = [channels(stops[index]), channels(stops[index + 1])];
  return `rgb(${from.map((value, channel) => Math.round(value + (to[channel] - value) * (place - index))).join(", ")})`;
}

/** The colour, let through. */
export const faint = (rgb, opacity) => `rgba(${channels(rgb).join(", ")}, ${opacity})`;

/** A colour scale from fresh to worn, for surfaces. */
export const scaleOf = (c) => [[0, c.fresh], [0.5, c.midlife], [1, c.worn]];
