// Where a chart of lines, points and bands has its axes, ticks and legend: computed before anything is drawn, so that the
// light drawing and the plotting library's, which takes its place, coincide.

import { fixed } from "../shared/format.js";

/** @typedef {{ size: number, family: string }} TextFont */

const ruler = /** @type {CanvasRenderingContext2D} */ (document.createElement("canvas").getContext("2d"));

/** @type {(text: string, font: TextFont) => number} px, without the markup of an index or an exponent */
export function widthOf(text, { size, family }) {
  ruler.font = `${size}px ${family}`;
  return ruler.measureText(text.replaceAll(/<[^>]+>/g, "")).width;
}

/**
 * The steps that the plotting library would choose: 1, 2 or 5 times a power of ten, at least about `least` px apart.
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

/** @type {(trace: Trace) => trace is PlainTrace} */
const isPlain = (trace) => (trace.type ?? "scatter") === "scatter" && !trace.xaxis && !trace.yaxis;

/**
 * Of an axis without a range of its own: all that is drawn, with some room where points would be cut.
 * @param {Axis} axis
 * @param {(number | null)[][]} columns
 * @param {number} room share of the range
 * @returns {Span}
 */
function rangeOf({ range, rangemode }, columns, room) {
  if (range) return range;
  let [low, high] = [Infinity, -Infinity];
  for (const column of columns) {
    for (const value of column) {
      if (value !== null && Number.isFinite(value)) [low, high] = [Math.min(low, value), Math.max(high, value)];
    }
  }
  if (low > high) return [0, 1];
  const zero = rangemode === "tozero" && low >= 0;
  if (zero) low = 0;
  const more = high > low ? room * (high - low) : 0.1 * Math.abs(high) || 1;
  return [zero ? 0 : low - more, high + more];
}

/** @type {(trace: PlainTrace) => (number | null)[][]} a trace's ordinates and both ends of its error bars */
function barsOf({ y, error_y: bars }) {
  if (!bars) return [y];
  /** @param {number} sign */
  const ends = (sign) => y.map((value, index) => (value === null ? null : value + sign * bars.array[index]));
  return [y, ends(-1), ends(1)];
}

const ENTRY = 40; // the line or point before a legend's text, px
const GAP = 5; // px

/**
 * The legend's entries, and how they are broken into rows of a width.
 * @param {PlainTrace[]} data
 * @param {TextFont} font
 * @param {number} width px
 * @returns {{ entries: LegendEntry[], rows: number, height: number }}
 */
function legendOf(data, font, width) {
  const entries = data
    .filter((trace) => trace.showlegend !== false && trace.name)
    .map((trace) => ({ trace, width: ENTRY + widthOf(trace.name ?? "", font), x: 0, y: 0 }));
  if (entries.length < 2) return { entries: [], rows: 0, height: 0 };
  const together = entries.reduce((sum, entry) => sum + entry.width + GAP, 0);
  const widest = Math.max(...entries.map((entry) => entry.width)) + GAP;
  const columns = together <= width ? entries.length : Math.max(1, Math.floor(width / widest));
  const rows = Math.ceil(entries.length / columns);
  const line = Math.max(16, 1.3 * font.size) + 3;
  let x = 0;
  entries.forEach((entry, index) => {
    if (index % columns === 0) x = 0;
    entry.x = x;
    entry.y = Math.floor(index / columns) * line + line / 2 + GAP;
    x += rows > 1 ? widest : entry.width + GAP;
  });
  return { entries, rows, height: rows * line };
}

/**
 * A figure whose layout names its ranges, margins and legend, with `ticks` and `legend` for who draws it light; null for
 * other figures than lines, points and bands over one pair of axes.
 * @param {WholeFigure} figure
 * @param {Size} size
 * @returns {SettledFigure | null}
 */
export function settled({ data, layout }, { width, height }) {
  if (layout.scene || !data.every(isPlain)) return null;
  const { font, margin, xaxis = {}, yaxis = {} } = layout;
  const marked = data.some((trace) => trace.mode.includes("markers"));
  const across = data.map((trace) => trace.x);
  const x = { ...xaxis, range: rangeOf(xaxis, across, marked ? 0.05 : 0.02), automargin: false };
  const y = { ...yaxis, range: rangeOf(yaxis, data.flatMap(barsOf), 0.05) };
  const legend = legendOf(data, { ...font, size: layout.legend.font.size }, width - 64 - margin.r);
  const below = 2 * 1.3 * font.size + 18; // labels and title of the abscissa
  const b = Math.round(legend.rows > 0 ? below + legend.height + 22 : below);
  const inside = height - margin.t - b;
  const yTicks = ticksOf(y.range, inside, 40);
  const widest = Math.max(0, ...yTicks.map(({ text }) => widthOf(text, font)));
  const l = Math.round(Math.max(56, widest + 1.3 * font.size + 24));
  const xTicks = ticksOf(x.range, width - l - margin.r, 80);
  const [last, [from, to]] = [xTicks.at(-1), x.range];
  const after = last ? ((width - l - margin.r) * (to - last.at)) / (to - from) : 0;
  const r = Math.max(margin.r, Math.ceil(0.5 * widthOf(last?.text ?? "", font) - after) + 3); // for its last value
  return {
    data,
    layout: {
      ...layout,
      showlegend: legend.rows > 0,
      margin: { ...margin, l, r, b },
      xaxis: x,
      yaxis: y,
      legend: { ...layout.legend, y: -below / inside },
    },
    ticks: { x: xTicks, y: yTicks },
    legend: { entries: legend.entries, top: height - b + below },
  };
}
