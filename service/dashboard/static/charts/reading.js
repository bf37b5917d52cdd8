// What a chart says under the pointer or by the arrow keys, and zooming: by dragging, + and −; Escape and a double click show all.

import { h, svg } from "../shared/dom.js";
import { dot } from "./draw.js";
import { readOut } from "./frame.js";

/** @typedef {{ frame: number, name: string, x: number, y: number, u: number, v: number, text: string }} Point u, v: px */
/** @typedef {{ framed: Framed | null, colours: Colours | null, zooms: Zoom[], redraw: () => void }} Drawn a chart as it is drawn */

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
  let [row, column] = [-1, 0];
  /** @type {{ frame: number, u: number, v: number } | null} where a drag began */
  let start = null;
  const said = h("p.readout", { role: "status", hidden: true });
  const all = () => (series ??= drawn.framed ? pointsOf(drawn.framed) : []);
  const over = () => plot.querySelector("svg");

  function hide() {
    said.hidden = true;
    over()?.querySelector(".pointed")?.remove();
  }

  /** @param {Point} point */
  function show({ u, v, name, text }) {
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

  /** @type {(index: number, corners: { u: number, v: number }[]) => void} show what is between two corners; one side may be too short to count */
  function zoom(index, [a, b]) {
    const { l, t, x, y, inside } = /** @type {Framed} */ (drawn.framed).frames[index];
    /** @type {(from: number, to: number, most: number, scale: Scale) => Span} */
    const span = (from, to, most, scale) => {
      if (Math.abs(to - from) < DRAGGED) return scale.range;
      const [low, high] = [from, to].map((px) => scale.from(Math.min(most, Math.max(0, px)))).sort((p, q) => p - q);
      return [low, high];
    };
    drawn.zooms[index] = { x: span(a.u - l, b.u - l, inside.width, x), y: span(a.v - t, b.v - t, inside.height, y) };
    drawn.redraw();
  }

  /** @type {(factor: number) => void} about the point that is read, or the middle */
  function zoomBy(factor) {
    const { framed } = drawn;
    if (!framed) return;
    const point = all()[row]?.[column];
    const index = point?.frame ?? 0;
    const { x, y, inside } = framed.frames[index];
    /** @type {(scale: Scale, middle: number, from: number, to: number) => Span} */
    const span = (scale, middle, from, to) => [
      scale.from(middle + (from - middle) * factor),
      scale.from(middle + (to - middle) * factor),
    ];
    const [u, v] = point ? [x.to(point.x), y.to(point.y)] : [inside.width / 2, inside.height / 2];
    drawn.zooms[index] = { x: span(x, u, 0, inside.width), y: span(y, v, inside.height, 0) };
    drawn.redraw();
  }

  function whole() {
    drawn.zooms.length = 0;
    drawn.redraw();
  }

  /** @type {(event: PointerEvent) => void} the rectangle that is dragged */
  function rubber(event) {
    const { u, v } = place(event);
    over()?.querySelector(".rubber")?.remove();
    if (!start || !drawn.framed || !drawn.colours) return;
    const { l, t, inside } = drawn.framed.frames[start.frame];
    const [wide, high] = [Math.abs(u - start.u) >= DRAGGED, Math.abs(v - start.v) >= DRAGGED];
    const box = {
      x: wide ? Math.min(u, start.u) : l,
      width: wide ? Math.abs(u - start.u) : inside.width,
      y: high ? Math.min(v, start.v) : t,
      height: high ? Math.abs(v - start.v) : inside.height,
    };
    if (wide || high) over()?.append(svg("rect.rubber", { ...box, fill: drawn.colours.accent, "fill-opacity": 0.15 }));
  }

  /** @param {PointerEvent} event */
  function moved(event) {
    if (start) return rubber(event);
    const { u, v } = place(event);
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
    Escape: whole,
  };

  /** @type {(rows: number, columns: number) => void} to another point, or to the nearest one of another curve */
  function step(rows, columns) {
    const lines = all();
    const before = lines[row]?.[column];
    if (before && rows === 0) column = Math.min(lines[row].length - 1, Math.max(0, column + columns));
    else row = Math.min(lines.length - 1, Math.max(0, row + rows));
    const line = lines[Math.max(0, row)] ?? [];
    if (before && rows !== 0)
      column = Math.max(0, line.indexOf(/** @type {Point} */ (nearest(line, before.u, before.v).point)));
    if (row < 0 || !before) [row, column] = [Math.max(0, row), 0];
    if (line[column]) show(line[column]);
  }

  plot.addEventListener("pointermove", moved);
  plot.addEventListener("pointerleave", () => !start && hide());
  plot.addEventListener("click", (event) => moved(/** @type {PointerEvent} */ (event)));
  plot.addEventListener("dblclick", whole);
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
    if (from && Math.max(Math.abs(to.u - from.u), Math.abs(to.v - from.v)) >= DRAGGED) zoom(from.frame, [from, to]);
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
