// Where a figure has its panels, axes, ticks and legend: computed before anything is drawn.

import { fixed } from "../shared/format.js";

/** @typedef {{ size: number, family: string }} TextFont */

const FAMILY = 'system-ui, -apple-system, "Segoe UI", Roboto, "Noto Sans", sans-serif';
/** Narrower panels than this stand below each other, px. */
const NARROW = 240;

const ruler = /** @type {CanvasRenderingContext2D} */ (document.createElement("canvas").getContext("2d"));

/** @type {(text: string) => string} without the markup of an index or an exponent */
export const plain = (text) => text.replaceAll(/<[^>]+>/g, "");

/** @type {(text: string, font: TextFont) => number} px */
export function widthOf(text, { size, family }) {
  ruler.font = `${size}px ${family}`;
  return ruler.measureText(plain(text)).width;
}

/**
 * Steps of 1, 2 or 5 times a power of ten, at least about `least` px apart.
 * @param {Span} range
 * @param {number} length px
 * @param {number} least px
 * @returns {Tick[]}
 */
export function ticksOf([from, to], length, least) {
  const rough = Math.abs(to - from) / (Math.min(9, Math.max(4, length / least)) + 1);
  const unit = 10 ** Math.floor(Math.log10(rough));
  const step = unit * ([2, 5].find((factor) => rough <= factor * unit) ?? 10);
  const decimals = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const first = Math.ceil(from / step - 1e-9);
  const count = Math.floor(to / step + 1e-9) - first + 1;
  return Array.from({ length: Math.max(0, count) }, (_, index) => {
    const at = (first + index) * step;
    return { at, text: fixed(at, decimals) };
  });
}

/** @type {(range: Span) => Tick[]} 1, 2 and 5 times the powers of ten */
function powersOf([from, to]) {
  const powers = Array.from({ length: 24 }, (_, index) => 10 ** (index - 8));
  const steps = powers.flatMap((power) => [power, 2 * power, 5 * power]);
  return steps
    .filter((at) => at >= from && at <= to)
    .map((at) => ({ at, text: fixed(at, Math.max(0, Math.ceil(-Math.log10(at)))) }));
}

/** @type {(names: string[], range: Span, most: number) => Tick[]} */
function namesOf(names, [from, to], most) {
  const step = Math.ceil((to - from) / Math.max(1, most));
  return names.map((text, at) => ({ at, text })).filter(({ at }) => at % step === 0 && at >= from && at <= to);
}

/**
 * Of an axis without a range of its own: all that is drawn, with some room where points would be cut.
 * @param {Axis} axis
 * @param {Values[]} columns
 * @param {number} room share of the range
 * @returns {Span}
 */
function rangeOf({ range, zero, log, names }, columns, room) {
  if (range) return range;
  if (names) return [-0.5, names.length - 0.5];
  let [low, high] = [Infinity, -Infinity];
  for (const column of columns) {
    for (const value of column) {
      if (value === null || !Number.isFinite(value) || (log && value <= 0)) continue;
      [low, high] = [Math.min(low, value), Math.max(high, value)];
    }
  }
  if (low > high) return [log ? 0.1 : 0, 1];
  if (log) return [low / (high / low) ** room, high * (high / low) ** room || 1];
  const whole = zero && low >= 0;
  if (whole) low = 0;
  const more = high > low ? room * (high - low) : 0.1 * Math.abs(high) || 1;
  return [whole ? 0 : low - more, high + more];
}

/** @type {(axis: Axis, range: Span, start: number, end: number, least: number) => Scale} px; `least` between ticks */
function scaleOf(axis, range, start, end, least) {
  const inner = axis.log ? Math.log10 : Number;
  const [from, to] = range.map(inner);
  const length = Math.abs(end - start);
  return {
    axis,
    range,
    to: (value) => start + ((end - start) * (inner(value) - from)) / (to - from),
    from: (px) => {
      const value = from + ((to - from) * (px - start)) / (end - start);
      return axis.log ? 10 ** value : value;
    },
    ticks: axis.names
      ? namesOf(axis.names, range, length / 40)
      : axis.log && to - from > 0.7
        ? powersOf(range)
        : ticksOf(range, length, least),
  };
}

/** @type {(axis: Axis, value: number, range: Span) => string} a value with the name and unit of its axis: pressure 5.0 bar */
export function readOut({ title, names }, value, [from, to]) {
  const [name, unit = ""] = plain(title).split(/, (?=[^,]*$)/);
  const decimals = Math.max(0, Math.min(8, Math.ceil(-Math.log10(Math.abs(to - from) / 300) - 1e-9)));
  return `${name} ${names?.[Math.round(value)] ?? fixed(value, decimals)} ${unit}`.trim();
}

/** @type {(curve: Curve) => Values[]} ordinates, both ends of error bars, both edges of a band */
function heightsOf({ y, half, lower }) {
  /** @param {number} sign */
  const ends = (sign) => y.map((value, index) => (value === null ? null : value + sign * (half?.[index] ?? 0)));
  return [ends(-1), ends(1), lower?.y ?? []];
}

const ENTRY = 40; // the line or point before a legend's text, px
const GAP = 5; // px

/** @type {(curves: Curve[], font: TextFont, width: number) => { entries: LegendEntry[], height: number }} each name once, in rows */
function legendOf(curves, font, width) {
  const entries = curves
    .filter(({ name }, index) => name && curves.findIndex((curve) => curve.name === name) === index)
    .map((curve) => ({ curve, width: ENTRY + widthOf(curve.name ?? "", font), x: 0, y: 0 }));
  if (entries.length < 2) return { entries: [], height: 0 };
  const together = entries.reduce((sum, entry) => sum + entry.width + GAP, 0);
  const widest = Math.max(...entries.map((entry) => entry.width)) + GAP;
  const columns = together <= width ? entries.length : Math.max(1, Math.floor(width / widest));
  const line = Math.max(16, 1.3 * font.size) + 3;
  let x = 0;
  entries.forEach((entry, index) => {
    if (index % columns === 0) x = 0;
    entry.x = x;
    entry.y = (Math.floor(index / columns) + 0.5) * line + GAP;
    x += entries.length > columns ? widest : entry.width + GAP;
  });
  return { entries, height: Math.ceil(entries.length / columns) * line + 2 * GAP };
}

/** @type {(panel: Panel, cell: Size & { left: number, top: number }, font: TextFont, zoom: Zoom) => Frame} */
function frameOf(panel, { left, top, width, height }, font, zoom) {
  const { curves, fields = [], title } = panel;
  const across = [...curves.flatMap(({ x, lower }) => [x, lower?.x ?? []]), ...fields.map(({ x }) => x)];
  const up = [...curves.flatMap(heightsOf), ...fields.map(({ y }) => y)];
  const room = fields.length > 0 ? 0 : curves.some(({ marker }) => marker) ? 0.05 : 0.02;
  const ranges = zoom ?? { x: rangeOf(panel.x, across, room), y: rangeOf(panel.y, up, fields.length > 0 ? 0 : 0.05) };
  const t = top + (title ? 1.3 * font.size + 14 : 12);
  const bottom = top + height - 2.6 * font.size - 18; // labels and title of the abscissa
  const y = scaleOf(panel.y, ranges.y, bottom - t, 0, 40);
  const labels = Math.max(0, ...y.ticks.map(({ text }) => widthOf(text, font)));
  const l = left + Math.round(Math.max(56, labels + 1.3 * font.size + 24));
  const most = left + width - l - 16;
  const { ticks, to } = scaleOf(panel.x, ranges.x, 0, most, 80);
  const last = ticks.at(-1);
  const over = last ? Math.max(0, to(last.at) + 0.5 * widthOf(last.text, font) + 3 - most - 16) : 0; // for its last value
  const inside = { width: most - over, height: bottom - t };
  return { panel, left, l, t, bottom: top + height, inside, x: scaleOf(panel.x, ranges.x, 0, inside.width, 80), y };
}

/**
 * A figure with its places; panels that stand below each other make it higher.
 * @param {Figure} figure
 * @param {Size} size
 * @param {Zoom[]} [zooms] by panel
 * @returns {Framed}
 */
export function framed(figure, { width, height }, zooms = []) {
  const font = { size: width < 480 ? 11 : 12.5, family: FAMILY };
  const columns = width / figure.length < NARROW ? 1 : figure.length;
  const rows = figure.length / columns;
  const curves = figure.flatMap((panel) => panel.curves);
  const { entries, height: more } = legendOf(curves, font, width - 80);
  const each = { width: width / columns, height: rows > 1 ? 0.8 * height : height - more };
  const cell = (/** @type {number} */ index) => ({
    ...each,
    left: (index % columns) * each.width,
    top: Math.floor(index / columns) * each.height,
  });
  const frames = figure.map((panel, index) => frameOf(panel, cell(index), font, zooms[index]));
  const under = rows * each.height;
  const legend = entries.map((entry) => ({ ...entry, x: entry.x + frames[0].l, y: entry.y + under }));
  return { frames, legend, size: { width, height: under + more }, font };
}
