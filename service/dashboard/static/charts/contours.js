// Isolines of a surface over a grid, linear between its points, and the surface as panels: the isolines beside the chosen cut.

import { readOut, ticksOf } from "./frame.js";
import { blend, rampOf } from "./palette.js";

/** @typedef {[number, number]} Point in the grid's units */
/** @typedef {Grid & { name: string, points: string, measured: { x: number, y: number, z: number }[] }} Surface */

/** @type {(corners: { at: Point, z: number }[], level: number) => { kept: Point[], ends: Point[] }} of a triangle, from a level up */
function cut(corners, level) {
  const [kept, ends] = [/** @type {Point[]} */ ([]), /** @type {Point[]} */ ([])];
  corners.forEach(({ at: [u, v], z }, index) => {
    const next = corners[(index + 1) % 3];
    if (z >= level) kept.push([u, v]);
    if (z >= level === next.z >= level) return;
    const share = (level - z) / (next.z - z);
    const crossing = /** @type {Point} */ ([u + share * (next.at[0] - u), v + share * (next.at[1] - v)]);
    kept.push(crossing);
    ends.push(crossing);
  });
  return { kept, ends };
}

/** @type {(grid: Grid, level: number) => { above: Point[][], lines: Point[][] }} what is at or above a level, and its edge */
export function isolines({ x, y, values }, level) {
  const [above, lines] = [/** @type {Point[][]} */ ([]), /** @type {Point[][]} */ ([])];
  for (let j = 1; j < y.length; j += 1) {
    for (let i = 1; i < x.length; i += 1) {
      const corners = [
        [i - 1, j - 1],
        [i, j - 1],
        [i, j],
        [i - 1, j],
      ].map(([u, v]) => ({ at: /** @type {Point} */ ([x[u], y[v]]), z: values[v][u] ?? NaN }));
      if (corners.some(({ z }) => Number.isNaN(z))) continue;
      const higher = corners.filter(({ z }) => z >= level).length;
      if (higher === 4) above.push(corners.map(({ at }) => at));
      if (higher === 4 || higher === 0) continue;
      for (const triangle of [corners.slice(0, 3), [corners[0], corners[2], corners[3]]]) {
        const { kept, ends } = cut(triangle, level);
        if (kept.length > 0) above.push(kept);
        if (ends.length === 2) lines.push(ends);
      }
    }
  }
  return { above, lines };
}

/** @type {(xs: number[], values: Values, at: number) => number | null} between the points; before them the first, past them none */
export function between(xs, values, at) {
  const next = xs.findIndex((x) => x >= at);
  if (next <= 0) return values[next] ?? null;
  const [a, b] = [values[next - 1], values[next]];
  if (a === null || b === null) return null;
  return a + ((b - a) * (at - xs[next - 1])) / (xs[next] - xs[next - 1]);
}

/** @type {(title: string, values: number[]) => [number, string][]} each with its name, to as many digits as distinguish them */
const named = (title, values) =>
  values.map((at) => [at, readOut({ title }, at, [0, 300 * Math.abs(values[1] - values[0])])]);

/**
 * The cuts that can be chosen: at every y, and at round values of x; and the one chosen, or the middle one.
 * @param {Surface[]} surfaces
 * @param {{ x: string, y: string }} titles
 * @param {string | undefined} wanted
 */
export function cutsOf(surfaces, { x, y }, wanted) {
  const [{ x: xs, y: ys }] = surfaces;
  const round = ticksOf([xs[0], xs[xs.length - 1]], 400, 80).map(({ at }) => at);
  /** @type {(axis: string, choices: [number, string][]) => [string, string][]} */
  const keyed = (axis, choices) => choices.map(([at, text]) => [`${axis} ${at}`, text]);
  const inside = round.filter((at) => at >= xs[0]);
  const options = [...keyed("y", named(y, ys)), ...keyed("x", named(x, inside))];
  const chosen = options.find(([key]) => key === wanted)?.[0] ?? `y ${ys[Math.floor(ys.length / 2)]}`;
  return { options, chosen };
}

/** @type {(points: Surface["measured"], up: "y" | "z") => Places} */
const placesOf = (points, up) => ({ x: points.map(({ x }) => x), y: points.map((point) => point[up]) });

/**
 * Isolines over x and y, filled where there is one surface, of several each in a colour; beside them z along the cut.
 * @param {Surface[]} surfaces
 * @param {{ x: string, y: string, z: Axis }} titles
 * @param {{ options: [string, string][], chosen: string }} cuts
 * @param {Colours} c
 * @returns {Figure}
 */
export function contoured(surfaces, { x, y, z }, { options, chosen }, c) {
  const all = surfaces.flatMap(({ values }) => values.flat().filter((value) => value !== null));
  const range = /** @type {Span} */ (z.range ?? [Math.min(...all), Math.max(...all)]);
  const levels = ticksOf(range, 400, 40).map(({ at }) => at);
  const several = surfaces.length > 1;
  const colour = (/** @type {number} */ index) => (several ? rampOf(c, index, surfaces.length) : c.accent);
  const [axis, text] = chosen.split(" ");
  const at = Number(text);
  const shade = (/** @type {number} */ level) =>
    blend([c.panel, c.accent], 0.1 + (0.6 * (level - range[0])) / (range[1] - range[0]));
  const cutLine = /** @type {Line} */ ({ color: c.worn, width: 2, dash: "dash" });
  const along = surfaces.map(({ name, x: xs, y: ys, values }, index) =>
    axis === "y"
      ? { name, x: xs, y: values[ys.indexOf(at)], line: { color: colour(index) } }
      : {
          name,
          x: ys,
          y: values.map((row) => between(xs, row, at)),
          line: { color: colour(index) },
          marker: { color: colour(index) },
        },
  );
  const measured = several ? [] : surfaces[0].measured;
  const near = measured.filter((point) => axis === "y" && point.y === at);
  return [
    {
      x: { title: x },
      y: { title: y },
      fields: surfaces.map((surface, index) => ({
        ...surface,
        z: z.title,
        ...(several ? { levels, line: colour(index) } : { levels: [-Infinity, ...levels], fill: shade }),
      })),
      curves: [{ ...placesOf(measured, "y"), marker: { color: c.quiet, size: 2 }, silent: true }],
      marks: [{ [axis]: at, line: cutLine, text: "" }],
    },
    {
      title: options.find(([key]) => key === chosen)?.[1],
      x: { title: axis === "y" ? x : y },
      y: z,
      curves: [
        ...along,
        { name: near.length > 0 ? surfaces[0].points : "", ...placesOf(near, "z"), marker: { color: c.ink, size: 4 } },
      ],
    },
  ];
}
