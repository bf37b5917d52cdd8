// Small drawings in a row of the fleet: plain SVG, no plotting library.

import { svg } from "./dom.js";

const WIDTH = 120;
const HEIGHT = 28;

/** A line through the values from left to right, its last point marked; the threshold dashed where it is known. */
export function sparkline(values, threshold = null) {
  const known = values.filter((value) => value !== null);
  if (known.length < 2) return null;
  const all = threshold === null ? known : [...known, threshold];
  const [low, high] = [Math.min(...all), Math.max(...all)];
  const x = (index) => 3 + ((WIDTH - 8) * index) / (known.length - 1);
  const y = (value) => 4 + (HEIGHT - 8) * (high > low ? (high - value) / (high - low) : 0.5);
  const line = known.map((value, index) => `${x(index).toFixed(1)},${y(value).toFixed(1)}`).join(" ");
  const last = known.length - 1;
  return svg("svg", { class: "spark", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, width: WIDTH, height: HEIGHT, "aria-hidden": "true" },
    threshold === null ? null : svg("line", { class: "threshold", x1: 0, x2: WIDTH, y1: y(threshold), y2: y(threshold) }),
    svg("polyline", { points: line }),
    svg("circle", { cx: x(last).toFixed(1), cy: y(known[last]).toFixed(1), r: 2.6 }));
}

/** Remaining cycles on a scale that all rows share: the 90 % interval, its middle half, the median. */
export function intervalBar(quantiles, scale) {
  const at = (value) => (value === null ? WIDTH : Math.min(WIDTH, (WIDTH * value) / scale));
  const [low, lower, middle, upper, high] = ["0.05", "0.25", "0.5", "0.75", "0.95"].map((name) => at(quantiles[name]));
  const bar = (from, to, name) => svg("rect", { class: name, x: from.toFixed(1), width: Math.max(1.5, to - from).toFixed(1), y: name === "wide" ? 5 : 3, height: name === "wide" ? 4 : 8, rx: 1.5 });
  return svg("svg", { class: "interval", viewBox: `0 0 ${WIDTH} 14`, width: WIDTH, height: 14, "aria-hidden": "true" },
    svg("line", { class: "axis", x1: 0, x2: WIDTH, y1: 7, y2: 7 }),
    bar(low, high, "wide"), bar(lower, upper, "half"),
    quantiles["0.5"] === null ? null : svg("rect", { class: "median", x: Math.min(WIDTH - 2, middle).toFixed(1), width: 2, y: 1, height: 12 }),
    quantiles["0.95"] === null || quantiles["0.95"] > scale ? svg("path", { class: "beyond", d: `M${WIDTH - 6} 3l5 4-5 4` }) : null);
}

/** Health from 0 to 1 as a bar. */
export function healthBar(health, state) {
  return svg("svg", { class: `health state-${state}`, preserveAspectRatio: "none", viewBox: "0 0 60 8", width: 60, height: 8, "aria-hidden": "true" },
    svg("rect", { class: "axis", width: 60, height: 8, rx: 4 }),
    svg("rect", { class: "fill", width: Math.max(health > 0 ? 3 : 0, 60 * health).toFixed(1), height: 8, rx: 4 }));
}
