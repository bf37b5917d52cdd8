// A chart drawn light: plain SVG, at once, of what the plotting library draws in its place as soon as it has loaded.

import { svg } from "./dom.js";

const along = ([from, to], start, end) => (value) => start + ((end - start) * (value - from)) / (to - from);
const px = (value) => value.toFixed(1);

/** A settled figure as SVG. */
export function sketch({ data, layout, ticks, legend }, { width, height }) {
  const { l, r, t, b } = layout.margin;
  const inside = { width: width - l - r, height: height - t - b };
  const x = along(layout.xaxis.range, 0, inside.width);
  const y = along(layout.yaxis.range, inside.height, 0);
  const { font } = layout;
  const lines = ([from, to, u, v], colour) => svg("line", { x1: px(from), x2: px(to), y1: px(u), y2: px(v), stroke: colour });
  return svg("svg", { class: "sketch", viewBox: `0 0 ${width} ${height}`, width, height, "aria-hidden": "true", "font-family": font.family, "font-size": font.size, fill: font.color },
    svg("rect", { width, height, fill: layout.paper_bgcolor }),
    ticks.x.map(({ at, text }) => [lines([l + x(at), l + x(at), t, t + inside.height + 4], layout.xaxis.gridcolor), label(text, { x: l + x(at), y: t + inside.height + 7 + font.size, "text-anchor": "middle" })]),
    ticks.y.map(({ at, text }) => [lines([l - 4, l + inside.width, t + y(at), t + y(at)], layout.yaxis.gridcolor), label(text, { x: l - 7, y: t + y(at) + 0.35 * font.size, "text-anchor": "end" })]),
    svg("svg", { x: l, y: t, ...inside, overflow: "hidden" }, data.map((trace, index) => drawn(trace, data[index - 1], x, y))),
    (layout.shapes ?? []).map((shape) => ruled(shape, { x, y, l, t, inside })),
    svg("path", { d: `M${l} ${t}V${t + inside.height}H${l + inside.width}`, fill: "none", stroke: layout.xaxis.linecolor }),
    (layout.annotations ?? []).map((note) => noted(note, { x, y, l, t, inside })),
    label(layout.xaxis.title?.text ?? "", { x: l + inside.width / 2, y: height - b + 2.3 * font.size + 10, "text-anchor": "middle" }),
    label(layout.yaxis.title?.text ?? "", { transform: `translate(${1.1 * font.size + 7} ${t + inside.height / 2}) rotate(-90)`, "text-anchor": "middle" }),
    legend.entries.map((entry) => key(entry, l, legend.top, layout.legend.font.size)));
}

/** A text with the library's small markup, index and exponent, as spans. */
function label(text, attributes) {
  const parts = text.split(/(<su[bp]>.*?<\/su[bp]>)/).filter(Boolean);
  let lowered = 0;
  return svg("text", attributes, parts.map((part) => {
    const [, kind, inner] = /^<(su[bp])>(.*)<\/su[bp]>$/.exec(part) ?? [null, null, part];
    const place = kind === null ? 0 : kind === "sub" ? 0.3 : -0.4;
    const moved = svg("tspan", { dy: place === lowered ? null : `${place - lowered}em`, "font-size": kind === null ? null : "70%" }, inner);
    lowered = place;
    return moved;
  }));
}

const DASHES = { dash: 3, dot: 1 };
const dashes = ({ dash, width }) => (dash ? Array(2).fill(DASHES[dash] * Math.max(3, width)).join(" ") : null);

/** The pen lifted where a value is missing. */
function pathOf(xs, ys) {
  let lifted = true;
  return xs.map((value, index) => {
    if (value === null || ys[index] === null) { lifted = true; return ""; }
    const step = `${lifted ? "M" : "L"}${px(value)} ${px(ys[index])}`;
    lifted = false;
    return step;
  }).join("");
}

function drawn(trace, before, x, y) {
  const place = (values, scale) => values.map((value) => (value === null ? null : scale(value)));
  const [xs, ys] = [place(trace.x, x), place(trace.y, y)];
  const { line = {}, marker = {}, error_y: bars } = trace;
  const parts = [];
  if (trace.fill === "tonexty") parts.push(svg("path", { d: `${pathOf(xs, ys)}${pathOf(place(before.x, x).reverse(), place(before.y, y).reverse()).replace("M", "L")}Z`, fill: trace.fillcolor }));
  if (bars) parts.push(svg("path", { d: xs.map((at, index) => `M${px(at)} ${px(y(trace.y[index] - bars.array[index]))}V${px(y(trace.y[index] + bars.array[index]))}`).join(""), stroke: bars.color, "stroke-width": bars.thickness }));
  if (trace.mode.includes("lines") && line.width !== 0) parts.push(svg("path", { d: pathOf(xs, ys), fill: "none", stroke: line.color, "stroke-width": line.width ?? 2, "stroke-dasharray": dashes(line) }));
  if (trace.mode.includes("markers")) parts.push(...xs.map((at, index) => (at === null || ys[index] === null ? null : dot(at, ys[index], marker, line))));
  return parts;
}

const dot = (x, y, marker, line) => svg("circle", { cx: px(x), cy: px(y), r: marker.size / 2, fill: marker.color ?? line.color, stroke: marker.line?.color ?? "none", "stroke-width": marker.line?.width ?? 0 });

/** A shape, which is a line; `paper` counts from 0 to 1 over the whole chart. */
function ruled({ x0, x1, y0, y1, xref, yref, line }, { x, y, l, t, inside }) {
  const [across, up] = [xref === "paper" ? (share) => share * inside.width : x, yref === "paper" ? (share) => (1 - share) * inside.height : y];
  return svg("svg", { x: l, y: t, ...inside, overflow: "hidden" },
    svg("line", { x1: px(across(x0)), x2: px(across(x1)), y1: px(up(y0)), y2: px(up(y1)), stroke: line.color, "stroke-width": line.width, "stroke-dasharray": dashes(line) }));
}

function noted({ x: at, y: level, xref, yref, text, textangle = 0, yanchor, font }, { x, y, l, t, inside }) {
  const left = l + (xref === "paper" ? at * inside.width : x(at)) + 2;
  const top = t + (yref === "paper" ? (1 - level) * inside.height : y(level)) + (yanchor === "top" ? 2 : -1.4 * font.size);
  const turned = textangle ? { transform: `translate(${px(left + 3)} ${px(top)}) rotate(${textangle})` } : { x: px(left), y: px(top + font.size) };
  return label(text, { ...turned, fill: font.color, "font-size": font.size });
}

function key({ trace, x, y }, l, top, size) {
  const { line = {}, marker = {} } = trace;
  const [from, middle] = [l + x + 5, top + y];
  const band = trace.fill === "tonexty";
  return svg("g", {},
    band ? svg("rect", { x: from, y: middle - 3, width: 30, height: 6, fill: trace.fillcolor }) : null,
    !band && trace.mode.includes("lines") ? svg("line", { x1: from, x2: from + 30, y1: middle, y2: middle, stroke: line.color, "stroke-width": Math.min(10, line.width ?? 2), "stroke-dasharray": dashes(line) }) : null,
    trace.mode.includes("markers") ? dot(from + 15, middle, marker, line) : null,
    label(trace.name, { x: l + x + 40, y: middle + 0.35 * size, "font-size": size }));
}
