// A figure as SVG: the one drawing of every chart, on the page, in the report and in saved files.

import { svg } from "../shared/dom.js";
import { isolines } from "./contours.js";
import { framed } from "./frame.js";
import { colours } from "./palette.js";

/** @import { Attributes } from "../shared/dom.js" */

/** @param {number} value */
export const px = (value) => value.toFixed(1);

/** @type {(figure: (c: Colours) => Figure, size: Size, text: string) => SVGSVGElement} without a chart about it */
export function drawnAlone(figure, size, text) {
  const c = colours();
  return draw(framed(figure(c), size), c, { class: "curve", role: "img", "aria-label": text });
}

/** @type {(whole: Framed, c: Colours, own: Attributes) => SVGSVGElement} */
export function draw({ frames, legend, size, font }, c, own) {
  const { width, height } = size;
  const box = { viewBox: `0 0 ${width} ${height}`, width, height, xmlns: "http://www.w3.org/2000/svg" };
  const type = { "font-family": font.family, "font-size": font.size, fill: c.ink };
  return svg(
    "svg",
    { ...own, ...box, ...type },
    svg("rect", { width, height, fill: c.panel }),
    frames.map((frame) => panelOf(frame, font.size, c)),
    legend.map((entry) => key(entry, font.size)),
  );
}

/** @type {(frame: Frame, size: number, c: Colours) => SVGElement[]} */
function panelOf(frame, size, c) {
  const { panel, left, l, t, bottom, inside, x, y } = frame;
  const axes = `M${l} ${t}V${t + inside.height}H${l + inside.width}`;
  const middle = l + inside.width / 2;
  const clip = { x: l, y: t, ...inside, overflow: "hidden" };
  return [
    ...(panel.title ? [label(panel.title, { x: middle, y: t - 8, "text-anchor": "middle", "font-weight": 600 })] : []),
    ...grid(frame, size, c),
    svg(
      "svg",
      clip,
      (panel.fields ?? []).flatMap((field) => fieldOf(field, x, y, size, c)),
      panel.curves.flatMap((curve) => curveOf(curve, x, y)),
      (panel.marks ?? []).map(({ x: at, y: level, line }) => {
        const d =
          at === undefined ? `M0 ${px(y.to(level ?? 0))}H${inside.width}` : `M${px(x.to(at))} 0V${inside.height}`;
        return svg("path", { d, fill: "none", ...strokeOf(line) });
      }),
    ),
    svg("path", { d: axes, fill: "none", stroke: c.edge }),
    ...(panel.marks ?? []).flatMap((mark) => noted(mark, frame) ?? []),
    label(panel.x.title, { x: middle, y: bottom - 8, "text-anchor": "middle" }),
    label(panel.y.title, {
      transform: `translate(${px(left + 1.1 * size + 7)} ${px(t + inside.height / 2)}) rotate(-90)`,
      "text-anchor": "middle",
    }),
  ];
}

/** @type {(frame: Frame, size: number, c: Colours) => SVGElement[]} lines with their values */
function grid({ x, y, l, t, inside }, size, c) {
  const bottom = t + inside.height;
  /** @type {(from: number, to: number, u: number, v: number) => SVGElement} */
  const line = (from, to, u, v) => svg("line", { x1: px(from), x2: px(to), y1: px(u), y2: px(v), stroke: c.line });
  return [
    ...x.ticks.flatMap(({ at, text }) => [
      line(l + x.to(at), l + x.to(at), t, bottom + 4),
      label(text, { x: px(l + x.to(at)), y: bottom + 7 + size, "text-anchor": "middle" }),
    ]),
    ...y.ticks.flatMap(({ at, text }) => [
      line(l - 4, l + inside.width, t + y.to(at), t + y.to(at)),
      label(text, { x: l - 7, y: px(t + y.to(at) + 0.35 * size), "text-anchor": "end" }),
    ]),
  ];
}

/**
 * A text with small markup for an index and an exponent, `<sub>` and `<sup>`, as spans.
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

const DASHES = { dash: 3, dot: 1 };

/** @param {Line} line */
function strokeOf({ color, dash, width = 2 }) {
  const length = dash && DASHES[dash] * Math.max(3, width);
  return { stroke: color, "stroke-width": width, "stroke-dasharray": length ? `${length} ${length}` : null };
}

/** @type {(values: Values, scale: Scale) => Values} px */
const placed = (values, { to }) =>
  values.map((value) => (value === null || !Number.isFinite(to(value)) ? null : to(value)));

/** @type {(xs: Values, ys: Values) => string} the pen lifted where a value is missing */
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

/** @type {(curve: Curve, x: Scale, y: Scale) => SVGElement[]} */
function curveOf({ x: at, y: values, line, marker, half, lower, fill }, x, y) {
  const [xs, ys] = [placed(at, x), placed(values, y)];
  const parts = [];
  if (lower) {
    const [there, back] = [pathOf(xs, ys), pathOf(placed(lower.x, x).reverse(), placed(lower.y, y).reverse())];
    // a band without a value is none: a path of "Z" alone is an error
    if (there && back) parts.push(svg("path", { d: `${there}${back.replace("M", "L")}Z`, fill }));
  }
  if (half) {
    const strokes = values.map((value, index) => {
      const u = xs[index];
      return value === null || u === null
        ? ""
        : `M${px(u)} ${px(y.to(value - half[index]))}V${px(y.to(value + half[index]))}`;
    });
    parts.push(svg("path", { d: strokes.join(""), stroke: marker?.color, "stroke-width": 1.1 }));
  }
  if (line) parts.push(svg("path", { d: pathOf(xs, ys), fill: "none", ...strokeOf(line) }));
  if (marker) {
    for (const [index, u] of xs.entries()) {
      const v = ys[index];
      if (u !== null && v !== null) parts.push(dot(u, v, marker));
    }
  }
  return parts;
}

/** @type {(x: number, y: number, marker: Marker) => SVGCircleElement} */
export const dot = (x, y, { color, size = 6, edge }) =>
  svg("circle", {
    cx: px(x),
    cy: px(y),
    r: size / 2,
    fill: color,
    stroke: edge?.color ?? "none",
    "stroke-width": edge?.width ?? 0,
  });

/** @type {(field: Field, x: Scale, y: Scale, size: number, c: Colours) => SVGElement[]} coloured cells, or isolines with values */
function fieldOf({ x: xs, y: ys, values, levels, fill, line: own }, x, y, size, c) {
  const line = own ?? c.ink;
  if (!levels) {
    return values.flatMap((row, j) =>
      row.flatMap((value, i) => {
        if (value === null) return [];
        const [left, top] = [x.to(xs[i] - 0.5), y.to(ys[j] + 0.5)];
        const cell = { width: px(x.to(xs[i] + 0.5) - left - 1), height: px(y.to(ys[j] - 0.5) - top - 1) };
        return [svg("rect", { x: px(left), y: px(top), ...cell, fill: fill?.(value) })];
      }),
    );
  }
  /** @param {[number, number]} point */
  const spot = ([u, v]) => `${px(x.to(u))} ${px(y.to(v))}`;
  const found = levels.map((level) => ({ level, ...isolines({ x: xs, y: ys, values }, level) }));
  return [
    ...(fill
      ? found.map(({ level, above }) =>
          svg("path", { d: above.map((p) => `M${p.map(spot).join("L")}Z`).join(""), fill: fill(level) }),
        )
      : []),
    ...found.map(({ lines }) =>
      svg("path", { d: lines.map((p) => `M${p.map(spot).join("L")}`).join(""), fill: "none", stroke: line }),
    ),
    ...found.flatMap(({ level, lines }) => {
      if (lines.length === 0) return [];
      const [u, v] = lines[Math.floor(lines.length / 2)][0];
      const halo = { stroke: c.panel, "stroke-width": 3, "paint-order": "stroke" };
      const place = { x: px(x.to(u)), y: px(y.to(v) + 0.35 * size), "text-anchor": "middle", "font-size": size - 1.5 };
      return [label(String(Number(level.toPrecision(6))), { ...place, ...halo, fill: line })];
    }),
  ];
}

/** @type {(mark: Mark, frame: Frame) => SVGTextElement | null} a mark's text beside its line, where that is in sight */
function noted({ x: at, y: level, text, turned, line }, { x, y, l, t, inside }) {
  const look = { fill: line.color, "font-size": turned ? 11 : 12 };
  const [place, length] = at === undefined ? [y.to(level ?? 0), inside.height] : [x.to(at), inside.width];
  if (place < 0 || place > length) return null;
  if (at === undefined) return label(text, { ...look, x: l + 2, y: px(t + place - 5) });
  return turned
    ? label(text, { ...look, transform: `translate(${px(l + place + 5)} ${px(t + 2)}) rotate(90)` })
    : label(text, { ...look, x: px(l + place - 4), y: t + 14, "text-anchor": "end" });
}

/** @type {(entry: LegendEntry, size: number) => SVGGElement} an entry of the legend */
function key({ curve: { name, line, marker, lower, fill }, x, y }, size) {
  const from = x + 5;
  return svg(
    "g",
    lower && svg("rect", { x: from, y: y - 3, width: 30, height: 6, fill }),
    line &&
      svg("line", {
        x1: from,
        x2: from + 30,
        y1: y,
        y2: y,
        ...strokeOf({ ...line, width: Math.min(10, line.width ?? 2) }),
      }),
    marker && dot(from + 15, y, marker),
    label(name ?? "", { x: x + 40, y: y + 0.35 * size }),
  );
}
