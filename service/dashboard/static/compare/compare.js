// Clutches, lives and states over one another: the address names them, so a link leads to the same view; answers of the API go in, two
// charts come out, a quantity over the cycles of each life and the Stribeck curves of its states, as measured or normalised to new.
// Its form changes the address, and the address is what is shown.

import { pollRaised } from "../alarms/raised.js";
import { Chart, choice } from "../charts/chart.js";
import { column, CYCLES, KIND, levelsOf } from "../charts/columns.js";
import { PARAMETER_NAMES } from "../charts/parameters.js";
import { spread } from "../charts/stribeck.js";
import { curveOf, highestOf, xyOf } from "../charts/stribeck_law.js";
import { planar } from "../charts/traces.js";
import { optionsOf, QUANTITIES, titleOf, usual } from "../quantities/names.js";
import { clutchPath, pageOf, read, readAll } from "../shared/api.js";
import { button, byId, form, h } from "../shared/dom.js";
import { fixed } from "../shared/format.js";
import { Live } from "../shared/live.js";
import { heldText } from "../shared/state.js";
import { named, placeUnits, pressureText, units } from "../shared/units.js";

/** @typedef {Awaited<ReturnType<typeof lifeOf>>} Life a life of a clutch, as it is compared, with its own tests */

/** Quantities that every stationary test gives. */
const CHOICES = optionsOf(QUANTITIES, ["mean_cof", ...PARAMETER_NAMES]);
/** @type {[string, string][]} */
const VALUES = Object.entries({ share: "normalised to new", measured: "as measured" });
const NO_TEST = { empty: "None of the compared lives has a stationary test yet." };
/** How many states of a life are drawn. */
const STATES = 3;
const DASHES = /** @type {const} */ ([undefined, "dash", "dot"]);
const overLife = new Chart({ id: "over-life", title: "Over the cycles of each life", wide: true, height: 400 });
const title = "Stribeck curves, first, middle and last test";
const curves = new Chart({ id: "curves", title, wide: true, height: 400 });

/** What is compared: the address. `clutch=a` is its present life, `clutch=a:1` its first. */
function question() {
  const query = new URLSearchParams(location.search);
  return {
    query,
    lives: query.getAll("clutch"),
    quantity: query.get("quantity") ?? "mean_cof",
    share: query.get("as") !== "measured",
  };
}

/** @param {(query: URLSearchParams) => void} change */
function go(change) {
  const { query } = question();
  change(query);
  history.pushState(null, "", `${location.pathname}?${query}`);
  live.now();
}

/**
 * @param {string} entry
 * @param {string} quantity
 */
async function lifeOf(entry, quantity) {
  const [, id, life] = /^(.*?)(?::(\d+))?$/.exec(entry) ?? ["", entry, undefined];
  const path = clutchPath(id);
  const number = life === undefined ? "" : `&life=${life}`;
  const [clutch, degradation, all] = await Promise.all([
    read(path),
    read(`${path}/degradation?quantity=${quantity}${number}`),
    readAll(`${path}/stribeck?limit=1000`),
  ]);
  const { life: own, items } = degradation.body;
  const measured = new Set(items.flatMap((item) => item.measured.cycles));
  const label = own.of > 1 ? `${id}, life ${own.number}` : id;
  const tests = all.items.filter(({ cycles }) => measured.has(cycles));
  return { label, clutch: clutch.body, answer: degradation.body, tests };
}

/** @param {DegradationItem[]} items */
function pooled(items) {
  const level = usual(levelsOf(items));
  return items.find((item) => item.pressure_bar === null) ?? items.find((item) => item.pressure_bar === level);
}

/** @param {Colours} c */
const palette = (c) => [c.accent, c.worn, c.high, c.midlife, c.low, c.ink];

/** @type {(lives: Life[], quantity: string, share: boolean) => Spec} */
function overLifeOf(lives, quantity, share) {
  const drawn = lives.flatMap(({ label, answer }) => {
    const item = pooled(answer.items);
    if (!item || item.measured.value.length === 0) return [];
    const unit = share ? item.measured.value[0] : 1;
    const from = answer.life.from_cycles ?? 0;
    const scaled = (/** @type {number[]} */ x, /** @type {number[]} */ y) => ({
      x: x.map((at) => at - from),
      y: y.map((value) => value / unit),
    });
    const { measured, trajectory } = item;
    return [
      { label, points: scaled(measured.cycles, measured.value), line: scaled(trajectory.cycles, trajectory.median) },
    ];
  });
  if (drawn.length === 0) return NO_TEST;
  const axis = share ? `${QUANTITIES[quantity].title}, share of new` : titleOf(QUANTITIES[quantity]);
  return {
    note: share
      ? "Each life relative to its own first test: 1 is new."
      : "As measured. Cycles count from the start of each life.",
    columns: [{ name: "life" }, KIND, CYCLES, column(axis, 4)],
    rows: drawn.flatMap(({ label, points, line }) => [
      ...points.x.map((at, index) => [label, "measured", at, points.y[index]]),
      ...line.x.map((at, index) => [label, "tracked", at, line.y[index]]),
    ]),
    figure: planar("duty cycles of the life", axis, [], (c) =>
      drawn.flatMap(({ label, points, line }, index) => {
        const color = palette(c)[index % 6];
        return [
          ...(line.x.length > 0 ? [{ name: label, ...line, line: { color } }] : []),
          { name: label, ...points, marker: { color } },
        ];
      }),
    ),
  };
}

/** @type {(lives: Life[], share: boolean) => Spec} */
function curvesOf(lives, share) {
  const { torque } = units();
  const drawn = lives.flatMap(({ label, clutch, tests, answer }, index) => {
    const level = usual(levelsOf(tests[0]?.fits ?? []));
    const fits = spread(tests, STATES).flatMap(({ cycles, fits: all }) => {
      const fit = all.find(({ pressure_bar: bar }) => bar === level);
      return fit ? [{ fit, cycles: cycles - (answer.life.from_cycles ?? 0) }] : [];
    });
    const states = fits.map(({ fit, cycles }) => ({ fit, cycles, drawn: curveOf(fit, clutch, 0, 2000) }));
    const unit = share && states.length > 0 ? highestOf(states[0].drawn) : 1;
    return states.map(({ fit, cycles, drawn: points }, state) => ({
      name: `${label}, ${fixed(cycles)} cycles, ${pressureText(level)}`,
      index,
      state,
      points: points.map(({ speed, torque: nm }) => ({
        speed,
        torque: share ? nm / unit : torque.of(nm, fit.pressure_bar, clutch),
      })),
    }));
  });
  if (drawn.length === 0) return NO_TEST;
  const axis = share ? "torque, share of the highest when new" : named(torque);
  return {
    note: "Fitted curves, one colour per life: solid for the first test, dashed for the middle one, dotted for the last.",
    columns: [{ name: "curve" }, column("speed, rpm"), column(axis, 4)],
    rows: drawn.flatMap((curve) => curve.points.map((point) => [curve.name, point.speed, point.torque])),
    figure: planar({ title: "sliding speed, rpm", zero: true }, axis, [], (c) =>
      drawn.map(({ name: curve, index, state, points }) => ({
        name: curve,
        ...xyOf(points),
        line: { color: palette(c)[index % 6], dash: DASHES[state] },
      })),
    ),
  };
}

/** @param {Life[]} lives */
function drawForm(lives) {
  const { quantity, share } = question();
  const entries = lives.map((life, index) => {
    const id = life.clutch.clutch_id;
    const numbers = Array.from(
      { length: life.answer.life.of },
      (_, n) => /** @type {[string, string]} */ ([`${id}:${n + 1}`, `life ${n + 1}`]),
    );
    const replace = (/** @type {string | null} */ value) =>
      go((query) => {
        const all = query.getAll("clutch");
        query.delete("clutch");
        all.forEach((old, at) => (at !== index ? query.append("clutch", old) : value && query.append("clutch", value)));
      });
    return h(
      "li",
      h("a", { href: pageOf(id) }, id),
      " ",
      life.clutch.held > 0 && h("span.mark-held", heldText(life.clutch.held)),
      numbers.length > 1 && choice("Life", numbers, `${id}:${life.answer.life.number}`, replace),
      button("Leave out", () => replace(null), { class: "small", "aria-label": `Remove ${life.label}` }),
    );
  });
  const input = h("input", { id: "add", placeholder: "clutch", required: true });
  const add = () => go((query) => query.append("clutch", input.value.trim()));
  byId("choices").replaceChildren(
    h("ul.compared", entries),
    form(add, h("div.row.finding", h("label", { for: "add" }, "Add"), input, h("button", "Add"))),
    h(
      "div.row.controls",
      choice("Quantity", CHOICES, quantity, (value) => go((query) => query.set("quantity", value))),
      choice("Values", VALUES, share ? "share" : "measured", (value) => go((query) => query.set("as", value))),
    ),
  );
}

let shown = "";
async function poll() {
  const { lives: entries, quantity, share } = question();
  const [lives] = await Promise.all([Promise.all(entries.map((entry) => lifeOf(entry, quantity))), pollRaised()]);
  const text = JSON.stringify([location.search, lives.map(({ answer }) => answer.revision)]);
  if (text === shown) return;
  shown = text;
  drawForm(lives);
  overLife.show(overLifeOf(lives, quantity, share));
  curves.show(curvesOf(lives, share));
}

byId("compared").append(overLife.element, curves.element);
addEventListener("popstate", () => live.now());
const live = new Live(poll, 5000);
placeUnits(byId("units"), () => {
  shown = "";
  live.now();
});
live.now();
