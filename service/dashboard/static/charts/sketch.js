// A chart drawn light: plain SVG, at once, of what the plotting library draws in its place as soon as it has loaded.

import { svg } from "../shared/dom.js";
import { settled } from "./frame.js";
import { base } from "./layout.js";
import { colours } from "./palette.js";

/** @import { Attributes } from "../shared/dom.js" */

/** @typedef {(value: number) => number} Scale from data to px inside the axes */
/** @typedef {{ x: Scale, y: Scale, l: number, t: number, inside: Size }} Frame scales, left and top margin, size inside */

/** @type {(range: Span, start: number, end: number) => Scale} */
const along =
  ([from, to], start, end) =>
  (value) =>
    start + ((end - start) * (value - from)) / (to - from);

/** What the plotting library draws in its place, and the chart's own text says what it shows. */
const HIDDEN = { class: "sketch", "aria-hidden": "true" };

/** @param {number} value */
const px = (value) => value.toFixed(1);

/** @type {(figure: (c: Colours) => Figure, size: Size, text: string) => SVGSVGElement | null} without a chart about it */
export function drawnAlone(figure, size, text) {
  const c = colours();
  const { data, layout } = figure(c);
  const whole = settled({ data, layout: base(c, layout, { height: size.height, compact: false }) }, size);
  return whole && sketch(whole, size, { class: "curve", role: "img", "aria-label": text });
}

/** @type {(figure: SettledFigure, size: Size, own?: Attributes) => SVGSVGElement} a settled figure as SVG */
export function sketch({ data, layout, ticks, legend }, { width, height }, own = HIDDEN) {
  const { font, margin, paper_bgcolor: ground } = layout;
  const { l, r, t, b } = margin;
  const inside = { width: width - l - r, height: height - t - b };
  const x = along(layout.xaxis.range, 0, inside.width);
  const y = along(layout.yaxis.range, inside.height, 0);
  const frame = { x, y, l, t, inside };
  const axes = `M${l} ${t}V${t + inside.height}H${l + inside.width}`;
  const attributes = {
    ...own,
    viewBox: `0 0 ${width} ${height}`,
    width,
    height,
    "font-family": font.family,
    "font-size": font.size,
    fill: font.color,
  };
  const titles = {
    x: { x: l + inside.width / 2, y: height - b + 2.3 * font.size + 10 },
    y: { transform: `translate(${1.1 * font.size + 7} ${t + inside.height / 2}) rotate(-90)` },
  };
  return svg(
    "svg",
    attributes,
    svg("rect", { width, height, fill: ground }),
    grid({ layout, ticks }, frame),
    svg(
      "svg",
      { x: l, y: t, ...inside, overflow: "hidden" },
      data.map((trace, index) => drawn(trace, data[index - 1], x, y)),
    ),
    (layout.shapes ?? []).map((shape) => ruled(shape, frame)),
    svg("path", { d: axes, fill: "none", stroke: layout.template.layout.xaxis.linecolor }),
    (layout.annotations ?? []).map((annotation) => noted(annotation, frame)),
    label(layout.xaxis.title?.text ?? "", { ...titles.x, "text-anchor": "middle" }),
    label(layout.yaxis.title?.text ?? "", { ...titles.y, "text-anchor": "middle" }),
    legend.entries.map((entry) => key(entry, l, legend.top, layout.legend.font.size)),
  );
}

/** @type {(figure: Pick<SettledFigure, "layout" | "ticks">, frame: Frame) => SVGElement[]} lines with their values */
function grid({ layout, ticks }, { x, y, l, t, inside }) {
  const { size } = layout.font;
  const bottom = t + inside.height;
  /** @type {(from: number, to: number, u: number, v: number, colour: string | undefined) => SVGElement} */
  const line = (from, to, u, v, colour) =>
    svg("line", { x1: px(from), x2: px(to), y1: px(u), y2: px(v), stroke: colour });
  return [
    ...ticks.x.flatMap(({ at, text }) => [
      line(l + x(at), l + x(at), t, bottom + 4, layout.template.layout.xaxis.gridcolor),
      label(text, { x: l + x(at), y: bottom + 7 + size, "text-anchor": "middle" }),
    ]),
    ...ticks.y.flatMap(({ at, text }) => [
      line(l - 4, l + inside.width, t + y(at), t + y(at), layout.template.layout.yaxis.gridcolor),
      label(text, { x: l - 7, y: t + y(at) + 0.35 * size, "text-anchor": "end" }),
    ]),
  ];
}

/**
 * A text with the library's small markup, index and exponent, as spans.
 * @type {(text: string, attributes: Record<string, string | number | undefined>) => SVGTextElement}
 */
function label(text, attributes) {
  const parts = text.split(/(<su[bp]>.*?<\/su[bp]>)/).filter(Boolean);
  let lowered = 0;
  const spans = parts.map((part) => {
    const [, kind, inner] = /^<(su[bp])>(.*)<\/su[bp]>$/.exec(part) ?? [null, null, part];
    const place = kind === null ? 0 : kind === "sub" ? 0.3 : -0.4;
    const dy = place === lowered ? null : `${place - lowered}em`;
    lowered = place;
    return svg("tspan", { dy, "font-size": kind === null ? null : "70%" }, inner);
  });
  return svg("text", attributes, spans);
}

/** @type {Record<string, number>} */
const DASHES = { dash: 3, dot: 1 };

/** @param {Line} line */
function strokeOf({ color, dash, width = 2 }) {
  const length = dash && DASHES[dash] * Math.max(3, width);
  return { stroke: color, "stroke-width": width, "stroke-dasharray": length ? `${length} ${length}` : null };
}

/** @type {(xs: (number | null)[], ys: (number | null)[]) => string} the pen lifted where a value is missing */
function pathOf(xs, ys) {
  let lifted = true;
  const steps = xs.map((x, index) => {
    const y = ys[index];
    if (x === null || y === null) {
      lifted = true;
      return "";
    }
    const step = `${lifted ? "M" : "L"}${px(x)} ${px(y)}`;
    lifted = false;
    return step;
  });
  return steps.join("");
}

/** @type {(values: (number | null)[], scale: Scale) => (number | null)[]} */
const placed = (values, scale) => values.map((value) => (value === null ? null : scale(value)));

/** @type {(trace: PlainTrace, before: PlainTrace | undefined, x: Scale, y: Scale) => SVGPathElement[]} */
function drawn(trace, before, x, y) {
  const [xs, ys] = [placed(trace.x, x), placed(trace.y, y)];
  const { line = {}, marker, error_y: bars } = trace;
  const parts = [];
  if (trace.fill === "tonexty" && before) {
    const [there, back] = [pathOf(xs, ys), pathOf(placed(before.x, x).reverse(), placed(before.y, y).reverse())];
    // a band without a value is none: a path of "Z" alone is an error
    if (there && back) parts.push(svg("path", { d: `${there}${back.replace("M", "L")}Z`, fill: trace.fillcolor }));
  }
  if (bars) {
    const strokes = trace.y.map((value, index) => {
      const at = xs[index];
      if (value === null || at === null) return "";
      return `M${px(at)} ${px(y(value - bars.array[index]))}V${px(y(value + bars.array[index]))}`;
    });
    parts.push(svg("path", { d: strokes.join(""), stroke: bars.color, "stroke-width": bars.thickness }));
  }
  if (trace.mode.includes("lines") && line.width !== 0) {
    parts.push(svg("path", { d: pathOf(xs, ys), fill: "none", ...strokeOf(line) }));
  }
  if (trace.mode.includes("markers")) {
    const dots = xs.map((at, index) => dot(at, ys[index], marker, line));
    parts.push(...dots.filter((circle) => circle !== null));
  }
  return parts;
}

/** The plotting library's own size of points, px, where a trace names none. */
const POINT = 6;

/** @type {(x: number | null, y: number | null, marker: Marker | undefined, line: Line) => SVGCircleElement | null} */
function dot(x, y, marker, line) {
  if (x === null || y === null) return null;
  return svg("circle", {
    cx: px(x),
    cy: px(y),
    r: (marker?.size ?? POINT) / 2,
    fill: marker?.color ?? line.color,
    stroke: marker?.line?.color ?? "none",
    "stroke-width": marker?.line?.width ?? 0,
  });
}

/** @type {(shape: Shape, frame: Frame) => SVGSVGElement} `paper` counts from 0 to 1 over the whole chart */
function ruled({ x0, x1, y0, y1, xref, yref, line }, { x, y, l, t, inside }) {
  /** @type {Scale} */
  const across = xref === "paper" ? (share) => share * inside.width : x;
  /** @type {Scale} */
  const up = yref === "paper" ? (share) => (1 - share) * inside.height : y;
  const ends = { x1: px(across(x0)), x2: px(across(x1)), y1: px(up(y0)), y2: px(up(y1)) };
  return svg("svg", { x: l, y: t, ...inside, overflow: "hidden" }, svg("line", { ...ends, ...strokeOf(line) }));
}

/** @type {(annotation: Annotation, frame: Frame) => SVGTextElement} a text beside its point */
function noted({ x: at, y: level, xref, yref, text, textangle = 0, xanchor, yanchor, font }, { x, y, l, t, inside }) {
  const size = font?.size ?? 12;
  const before = xanchor === "right";
  const left = l + (xref === "paper" ? at * inside.width : x(at)) + (before ? -4 : 2);
  const top = t + (yref === "paper" ? (1 - level) * inside.height : y(level)) + (yanchor === "top" ? 2 : -1.4 * size);
  const place = textangle
    ? { transform: `translate(${px(left + 3)} ${px(top)}) rotate(${textangle})` }
    : { x: px(left), y: px(top + size), "text-anchor": before ? "end" : "start" };
  return label(text, { ...place, fill: font?.color ?? "currentColor", "font-size": size });
}

/** @type {(entry: LegendEntry, l: number, top: number, size: number) => SVGGElement} an entry of the legend */
function key({ trace, x, y }, l, top, size) {
  const { line = {}, marker } = trace;
  const [from, middle] = [l + x + 5, top + y];
  const band = trace.fill === "tonexty";
  const stroke = { ...strokeOf(line), "stroke-width": Math.min(10, line.width ?? 2) };
  return svg(
    "g",
    band && svg("rect", { x: from, y: middle - 3, width: 30, height: 6, fill: trace.fillcolor }),
    !band &&
      trace.mode.includes("lines") &&
      svg("line", { x1: from, x2: from + 30, y1: middle, y2: middle, ...stroke }),
    trace.mode.includes("markers") && dot(from + 15, middle, marker, line),
    label(trace.name ?? "", { x: l + x + 40, y: middle + 0.35 * size, "font-size": size }),
  );
}
