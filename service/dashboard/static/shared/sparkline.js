// Small drawings in a row of the fleet: plain SVG.

import { svg } from "./dom.js";

const WIDTH = 120;
const HEIGHT = 28;

/**
 * A line through the values from left to right, its last point marked; the threshold dashed where there is one.
 * @type {(values: (number | null)[], threshold?: number | null) => SVGSVGElement | null}
 */
export function sparkline(values, threshold = null) {
  const numbers = values.filter((value) => value !== null);
  if (numbers.length < 2) return null;
  const all = threshold === null ? numbers : [...numbers, threshold];
  const [low, high] = [Math.min(...all), Math.max(...all)];
  const last = numbers.length - 1;
  /** @param {number} index */
  const x = (index) => (3 + ((WIDTH - 8) * index) / last).toFixed(1);
  /** @param {number} value */
  const y = (value) => (4 + (HEIGHT - 8) * (high > low ? (high - value) / (high - low) : 0.5)).toFixed(1);
  const points = numbers.map((value, index) => `${x(index)},${y(value)}`).join(" ");
  const level = threshold === null ? null : y(threshold);
  return svg(
    "svg.spark",
    { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, width: WIDTH, height: HEIGHT, "aria-hidden": "true" },
    level !== null && svg("line.threshold", { x1: 0, x2: WIDTH, y1: level, y2: level }),
    svg("polyline", { points }),
    svg("circle", { cx: x(last), cy: y(numbers[last]), r: 2.6 }),
  );
}

/**
 * Remaining cycles on a scale that all rows share: the 90 % interval, its middle half, the median.
 * @param {Quantiles} quantiles
 * @param {number} scale cycles at the bar's right end
 */
export function intervalBar(quantiles, scale) {
  /** @param {string} name */
  const at = (name) => {
    const value = quantiles[name];
    return value === null ? WIDTH : Math.min(WIDTH, (WIDTH * value) / scale);
  };
  /** @type {(from: number, to: number, size: { class: string, y: number, height: number }) => SVGRectElement} */
  const bar = (from, to, size) =>
    svg("rect", { ...size, x: from.toFixed(1), width: Math.max(1.5, to - from).toFixed(1), rx: 1.5 });
  const [median, high] = [quantiles["0.5"], quantiles["0.95"]];
  const beyond = high === null || high > scale;
  const most = WIDTH - (beyond ? 9 : 2); // beside the arrow
  return svg(
    "svg.interval",
    { viewBox: `0 0 ${WIDTH} 14`, width: WIDTH, height: 14, "aria-hidden": "true" },
    svg("line.axis", { x1: 0, x2: WIDTH, y1: 7, y2: 7 }),
    bar(at("0.05"), at("0.95"), { class: "wide", y: 5, height: 4 }),
    bar(at("0.25"), at("0.75"), { class: "half", y: 3, height: 8 }),
    median !== null && svg("rect.median", { x: Math.min(most, at("0.5")).toFixed(1), width: 2, y: 1, height: 12 }),
    beyond && svg("path.beyond", { d: `M${WIDTH - 6} 3l5 4-5 4` }),
  );
}

/** @type {(share: number, look: Record<string, string | Record<string, string>>) => SVGSVGElement} from 0 to 1, as a bar */
export function shareBar(share, look) {
  const width = Math.max(share > 0 ? 3 : 0, 60 * share).toFixed(1);
  const box = { preserveAspectRatio: "none", viewBox: "0 0 60 8", width: 60, height: 8 };
  return svg(
    "svg",
    { ...look, ...box, "aria-hidden": "true" },
    svg("rect.axis", { width: 60, height: 8, rx: 4 }),
    svg("rect.fill", { width, height: 8, rx: 4 }),
  );
}
