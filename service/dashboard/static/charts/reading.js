// What a chart says under the pointer or by the arrow keys, and zooming: by dragging, + and −; Escape and a double click show all.

import { h, svg } from "../shared/dom.js";
import { dot } from "./draw.js";
import { readOut } from "./frame.js";

/** @typedef {{ frame: number, name: string, x: number, y: number, u: number, v: number, text: string }} Point u, v: px */
/** @typedef {{ u: number, v: number }} Spot px */
/** @typedef {{ framed: Framed | null, colours: Colours | null, zooms: Zoom[], redraw: () => void, showAll: () => void }} Drawn a chart as it is drawn */

/** How near the pointer has to be, and how far it has to be dragged, px. */
const [NEAR, DRAGGED] = [60, 12];

/** @type {(framed: Framed) => Point[][]} what can be read, by curves and fields; what is out of sight is not */
function pointsOf({ frames }) {
  return frames.flatMap(({ panel, x, y, l, t, inside }, frame) => {
    /** @type {(name: string, at: number, level: number, more: string) => Point[]} */
    const point = (name, at, level, more) => {
      const [u, v] = [x.to(at), y.to(level)];
      if (!(u >= -1 && u <= inside.width + 1 && v >= -1 && v <= inside.height + 1)) return [];
      const text = [readOut(x.axis, at, x.range), readOut(y.axis, level, y.range) + more].filter(Boolean).join(", ");
      return [
        { frame, name: [panel.title, name].filter(Boolean).join(", "), x: at, y: level, u: l + u, v: t + v, text },
      ];
    };
    const curves = panel.curves.map(({ name = "", x: xs, y: ys, half, lower, silent }) =>
      xs.flatMap((at, index) => {
        const level = ys[index];
        if (at === null || level === null || silent || lower) return [];
        const bar = half?.[index] ? ` ± ${readOut({ title: "" }, half[index], y.range)} (90 %)` : "";
        return point(name, at, level, bar);
      }),
    );
    const fields = (panel.fields ?? []).map(({ name = "", z, x: xs, y: ys, values }) => {
      const all = values.flat().filter((value) => value !== null);
      const range = /** @type {Span} */ ([Math.min(...all), Math.max(...all)]);
      return values.flatMap((row, j) =>
        row.flatMap((value, i) =>
          value === null ? [] : point(name, xs[i], ys[j], `, ${readOut({ title: z }, value, range)}`),
        ),
      );
    });
    return [...curves, ...fields].filter((points) => points.length > 0);
  });
}

/** @type {(from: Spot, to: Spot) => boolean} */
const dragged = (from, to) => Math.max(Math.abs(to.u - from.u), Math.abs(to.v - from.v)) >= DRAGGED;

/** @type {(points: Point[], u: number, v: number) => { point: Point | null, distance: number }} */
function nearest(points, u, v) {
  let [found, least] = [/** @type {Point | null} */ (null), Infinity];
  for (const point of points) {
    const distance = (point.u - u) ** 2 + (point.v - v) ** 2;
    if (distance < least) [found, least] = [point, distance];
  }
  return { point: found, distance: Math.sqrt(least) };
}

/** @type {(plot: HTMLElement, drawn: Drawn) => () => void} listens at a chart's place; what it returns forgets what is read */
export function reading(plot, drawn) {
  /** @type {Point[][] | null} */
  let series = null;
  /** @type {Point | null} what is read out */
  let read = null;
  /** @type {(Spot & { frame: number }) | null} where a drag began */
  let start = null;
  const said = h("p.readout", { role: "status", hidden: true });
  const all = () => (series ??= drawn.framed ? pointsOf(drawn.framed) : []);
  const over = () => plot.querySelector("svg");

  function hide() {
    said.hidden = true;
    over()?.querySelector(".pointed")?.remove();
  }

  /** @param {Point} point */
  function show(point) {
    const { u, v, name, text } = (read = point);
    hide();
    if (!drawn.framed || !drawn.colours) return;
    const { ink, panel } = drawn.colours;
    over()?.append(svg("g.pointed", dot(u, v, { color: ink, size: 9, edge: { color: panel, width: 2 } })));
    if (!said.isConnected) plot.append(said);
    said.replaceChildren(...(name ? [h("b", name), h("br")] : []), text);
    said.hidden = false;
    const right = u > drawn.framed.size.width / 2;
    said.style.left = right ? "" : `${u + 12}px`;
    said.style.right = right ? `${drawn.framed.size.width - u + 12}px` : "";
    said.style.top = `${Math.max(0, v - 50)}px`;
  }

  /** @param {PointerEvent | MouseEvent} event */
  function place(event) {
    const box = plot.getBoundingClientRect();
    return { u: event.clientX - box.left, v: event.clientY - box.top };
  }

  /** @type {(u: number, v: number) => number} the panel there */
  const frameAt = (u, v) =>
    (drawn.framed?.frames ?? []).findIndex(
      ({ l, t, inside }) => u >= l && u <= l + inside.width && v >= t && v <= t + inside.height,
    );

  /** @type {(frame: Frame, a: Spot, b: Spot) => { x: Span, y: Span }} between two corners, px; a side that is too short is the whole one */
  function boxOf({ l, t, inside }, a, b) {
    /** @type {(from: number, to: number, start: number, length: number) => Span} */
    const side = (from, to, start, length) =>
      Math.abs(to - from) < DRAGGED
        ? [0, length]
        : [Math.max(0, Math.min(from, to) - start), Math.min(length, Math.max(from, to) - start)];
    return { x: side(a.u, b.u, l, inside.width), y: side(a.v, b.v, t, inside.height) };
  }

  /** @type {(index: number, box: { x: Span, y: Span }) => void} show a part of a panel's axes, px */
  function zoom(index, box) {
    const { x, y } = /** @type {Framed} */ (drawn.framed).frames[index];
    drawn.zooms[index] = { x: [x.from(box.x[0]), x.from(box.x[1])], y: [y.from(box.y[1]), y.from(box.y[0])] };
    drawn.redraw();
  }

  /** @type {(factor: number) => void} about the point that is read, or the middle */
  function zoomBy(factor) {
    const [row, column] = placeOf(all());
    const point = all()[row]?.[column];
    const frame = drawn.framed?.frames[point?.frame ?? 0];
    if (!frame) return;
    const { x, y, inside } = frame;
    const [u, v] = point ? [x.to(point.x), y.to(point.y)] : [inside.width / 2, inside.height / 2];
    /** @type {(middle: number, length: number) => Span} */
    const side = (middle, length) => [middle * (1 - factor), middle + (length - middle) * factor];
    zoom(point?.frame ?? 0, { x: side(u, inside.width), y: side(v, inside.height) });
  }

  /** @param {Spot} to the rectangle that is dragged to there */
  function rubber(to) {
    over()?.querySelector(".rubber")?.remove();
    const frame = drawn.framed?.frames[start?.frame ?? 0];
    if (!start || !frame || !dragged(start, to)) return;
    const { x, y } = boxOf(frame, start, to);
    const box = { x: frame.l + x[0], y: frame.t + y[0], width: x[1] - x[0], height: y[1] - y[0] };
    over()?.append(svg("rect.rubber", { ...box, fill: drawn.colours?.accent, "fill-opacity": 0.15 }));
  }

  /** @param {PointerEvent} event */
  function moved(event) {
    const { u, v } = place(event);
    if (start) return rubber({ u, v });
    const { point, distance } = nearest(all().flat(), u, v);
    if (point && distance < NEAR) show(point);
    else hide();
  }

  /** @type {Record<string, () => void>} */
  const keys = {
    ArrowRight: () => step(0, 1),
    ArrowLeft: () => step(0, -1),
    ArrowDown: () => step(1, 0),
    ArrowUp: () => step(-1, 0),
    Home: () => step(0, -Infinity),
    End: () => step(0, Infinity),
    "+": () => zoomBy(0.5),
    "-": () => zoomBy(2),
    Escape: () => drawn.showAll(),
  };

  /** @type {(rows: number, columns: number) => void} to another point, or to the nearest one of another curve */
  function step(rows, columns) {
    const lines = all();
    const [row, column] = placeOf(lines);
    const clamped = (/** @type {number} */ at, /** @type {unknown[]} */ of) => Math.min(of.length - 1, Math.max(0, at));
    const line = lines[clamped(row + rows, lines)] ?? [];
    const before = lines[row]?.[column];
    const next = before && rows !== 0 ? nearest(line, before.u, before.v).point : line[clamped(column + columns, line)];
    if (next) show(next);
  }

  /** @type {(lines: Point[][]) => [number, number]} curve and number of the point that is read; before the first: one before */
  function placeOf(lines) {
    const same = (/** @type {Point} */ { frame, name, x, y }) =>
      frame === read?.frame && name === read.name && x === read.x && y === read.y;
    const row = lines.findIndex((line) => line.some(same));
    return row < 0 ? [0, -1] : [row, lines[row].findIndex(same)];
  }

  plot.addEventListener("pointermove", moved);
  plot.addEventListener("pointerleave", () => !start && hide());
  plot.addEventListener("click", (event) => moved(/** @type {PointerEvent} */ (event)));
  plot.addEventListener("dblclick", () => drawn.showAll());
  plot.addEventListener("pointercancel", () => (start = null));
  plot.addEventListener("pointerdown", (event) => {
    const { u, v } = place(event);
    const frame = frameAt(u, v);
    if (frame < 0 || event.button !== 0) return;
    start = { frame, u, v };
    hide();
    plot.setPointerCapture(event.pointerId);
  });
  plot.addEventListener("pointerup", (event) => {
    const from = start;
    start = null;
    over()?.querySelector(".rubber")?.remove();
    const to = place(event);
    if (from && drawn.framed && dragged(from, to)) zoom(from.frame, boxOf(drawn.framed.frames[from.frame], from, to));
  });
  plot.addEventListener("keydown", (event) => {
    const act = keys[event.key];
    if (!act || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    act();
  });
  return () => {
    series = null;
    hide();
  };
}
