// @ts-check
// The clutch page's charts and the choices above them.

import { Chart, choice, setControls } from "../charts/chart.js";
import { fan } from "../charts/fan.js";
import { meanCof, remainingCycles } from "../charts/life.js";
import { loopCurves, loopPressures } from "../charts/loops.js";
import { landscape, parameter, PARAMETER_NAMES, PARAMETERS } from "../charts/parameters.js";
import { flat, pressuresOf, spread, surface } from "../charts/stribeck.js";
import { Engagements } from "../engagements/engagements.js";
import { byMeanCof } from "../quantities/criteria.js";
import { levelOptions, stateOptions, usual } from "../quantities/choices.js";
import { Quantities } from "../quantities/quantities.js";
import { readDrawn } from "../shared/api.js";

/** @import { Prediction } from "../charts/fan.js" */
/** @import { ParameterName } from "../charts/parameters.js" */
/** @import { Depth } from "../charts/stribeck.js" */
/** @import { Channels, ClutchOut, DegradationItem, LoopItem, Receipt, RemainingLife, StribeckItem } from "../shared/types.js" */

/**
 * @typedef {object} Answers what the page has read of the clutch
 * @property {ClutchOut} clutch
 * @property {RemainingLife | null} life
 * @property {DegradationItem[]} items
 * @property {Prediction[]} predictions
 * @property {StribeckItem[]} tests
 * @property {LoopItem[]} loops
 * @property {Receipt[]} runs
 * @property {Receipt[]} events
 */

/**
 * @typedef {object} Choices
 * @property {number} [pressure]
 * @property {string} [run]
 * @property {"state" | "pressure"} curvesBy
 * @property {Depth} over
 * @property {ParameterName} parameter
 * @property {"state" | "pressure"} loopsOver
 * @property {number} [loopPressure]
 * @property {string} [loopRun]
 */

/** Most tests whose records the surface over cycles draws. */
const MOST_ON_SURFACE = 9;
/** @type {["state" | "pressure", string][]} */
const BY = [
  ["state", "state"],
  ["pressure", "pressure"],
];
/** @type {[Depth, string][]} */
const DEPTHS = [
  ["pressure", "pressure"],
  ["states", "pressure, several states"],
  ["cycles", "cycles"],
];

/**
 * The charts, each in its section.
 * @param {() => string} name
 * @param {(section: string) => HTMLElement} place
 */
function makeCharts(name, place) {
  /** @type {(section: string, options: Omit<import("../charts/chart.js").Options, "name">) => Chart} */
  const add = (section, options) => {
    const chart = new Chart({ name, ...options });
    place(section).append(chart.element);
    return chart;
  };
  const fan = add("life", { id: "fan", title: "Mean COF against its threshold", wide: true, height: 420 });
  const remaining = add("life", { id: "predicted", title: "Remaining cycles, as predicted" });
  const cof = add("life", { id: "cof", title: "Mean COF by pressure" });
  const curves = add("stribeck", { id: "stribeck", title: "Stribeck curves", height: 440 });
  const surface = add("stribeck", { id: "surface", title: "Stribeck curves in 3D", spatial: true, height: 440 });
  const parameters = PARAMETER_NAMES.map((key) => {
    const { title, symbol: letter } = PARAMETERS[key];
    return { key, chart: add("parameters", { id: key.replaceAll("_", "-"), title, letter, height: 300 }) };
  });
  const overAll = { id: "landscape", title: "A parameter over cycles and pressure", spatial: true, wide: true };
  const landscape = add("parameters", { ...overAll, height: 440 });
  const loops = add("loops", { id: "loop-curves", title: "Loops: torque over speed", wide: true, height: 420 });
  return { fan, remaining, cof, curves, surface, parameters, landscape, loops };
}

export class Board {
  /**
   * @param {string} clutchId
   * @param {() => string} name the start of saved files' names
   * @param {(section: string) => HTMLElement} place where a section's charts go
   */
  constructor(clutchId, name, place) {
    this.clutchId = clutchId;
    this.charts = makeCharts(name, place);
    this.engagements = new Engagements(clutchId, name, place("engagements"));
    this.quantities = new Quantities(clutchId, name, place);
    /** @type {Answers | null} */
    this.answers = null;
    /** @type {Record<string, Channels>} */
    this.channels = {};
    /** @type {Choices} */
    this.chosen = { curvesBy: "state", over: "pressure", loopsOver: "state", parameter: "static_torque_nm" };
  }

  /**
   * The charts of the remaining life, which come first.
   * @param {Answers & { life: RemainingLife }} answers
   */
  life({ life: all, items, predictions, tests, events }) {
    const life = byMeanCof(all);
    const pooled = items.find((item) => item.quantity === "mean_cof" && item.pressure_bar === null);
    this.charts.remaining.show(remainingCycles({ life, predictions, events }));
    if (tests.length > 0) this.charts.cof.show(meanCof({ tests, events }));
    this.charts.fan.show(fan({ life, pooled, predictions, events }));
  }

  /** @param {Answers} answers for all other charts */
  async rest(answers) {
    this.answers = answers;
    this.charts.cof.show(meanCof(answers));
    this.parameters(answers);
    this.quantities.show(answers);
    await this.readChannels(answers);
    this.stribeck(answers);
    this.loopCurves(answers);
    await this.engagements.show(answers.runs, answers.events);
  }

  /**
   * The channels of the tests that are drawn; a run's samples never change, so each is read once.
   * @param {Answers} answers
   */
  async readChannels({ tests, loops }) {
    const dynamic = [...new Set(loops.map((loop) => loop.run_id))];
    const stationary = tests.map((test) => test.run_id);
    const spatial = this.chosen.over === "cycles" ? spread(stationary, MOST_ON_SURFACE) : [];
    const picked = [this.chosen.run, this.chosen.loopRun].filter(
      (id) => stationary.includes(id ?? "") || dynamic.includes(id ?? ""),
    );
    const ids = new Set([...spread(stationary), ...spread(dynamic), ...spatial, ...picked]);
    await Promise.all([...ids].map((id) => this.readRun(id)));
  }

  /** @param {string | undefined} id */
  async readRun(id) {
    if (id === undefined || this.channels[id]) return;
    this.channels[id] = (await readDrawn(this.clutchId, id)).body.channels;
  }

  /**
   * Draw again, with the answers that are there.
   * @param {(answers: Answers) => void} draw
   */
  again(draw) {
    if (this.answers) draw(this.answers);
  }

  /**
   * The chosen pressure, or the one closest to the usual; undefined before the first test.
   * @param {Answers} answers
   */
  pressure({ tests }) {
    return usual(pressuresOf(tests), this.chosen.pressure);
  }

  /** @param {Answers} answers */
  pressureChoice(answers) {
    return choice("Pressure", levelOptions(pressuresOf(answers.tests)), this.pressure(answers), (value) => {
      this.chosen.pressure = Number(value);
      this.again((latest) => {
        this.stribeck(latest);
        this.parameters(latest);
      });
    });
  }

  /** @param {Answers} answers */
  stribeck(answers) {
    const { tests, clutch } = answers;
    const { over, curvesBy: by } = this.chosen;
    const { curves, surface: spatial } = this.charts;
    const run = tests.some((test) => test.run_id === this.chosen.run) ? this.chosen.run : tests[0]?.run_id;
    const shared = { tests, clutch, channels: this.channels, pressure: this.pressure(answers), run };
    const redraw = () => this.again((latest) => this.stribeck(latest));
    const state = () =>
      choice("State", stateOptions(tests), run, async (value) => {
        this.chosen.run = value;
        await this.readRun(value);
        redraw();
      });
    const colour = choice("Colour by", BY, by, (value) => {
      this.chosen.curvesBy = value === "pressure" ? "pressure" : "state";
      redraw();
    });
    setControls(curves, tests.length > 0 ? [colour, by === "state" ? this.pressureChoice(answers) : state()] : []);
    curves.show(flat({ ...shared, by }));
    const axis = choice("Torque over speed and", DEPTHS, over, async (value) => {
      this.chosen.over = DEPTHS.map(([depth]) => depth).find((depth) => depth === value) ?? over;
      if (this.answers) await this.readChannels(this.answers);
      redraw();
    });
    const more = { pressure: state, states: null, cycles: () => this.pressureChoice(answers) }[over];
    setControls(spatial, tests.length > 0 ? [axis, ...(more ? [more()] : [])] : []);
    spatial.show(surface({ ...shared, over }));
  }

  /** @param {Answers} answers */
  parameters(answers) {
    const { items, events, tests } = answers;
    const pressure = this.pressure(answers);
    for (const { key, chart } of this.charts.parameters) {
      setControls(chart, tests.length > 0 ? [this.pressureChoice(answers)] : []);
      chart.show(parameter({ items, events, name: key, pressure }));
    }
    const { parameter: name } = this.chosen;
    const which = choice(
      "Parameter",
      PARAMETER_NAMES.map((key) => [key, PARAMETERS[key].title]),
      name,
      (value) => {
        this.chosen.parameter = PARAMETER_NAMES.find((key) => key === value) ?? name;
        this.again((latest) => this.parameters(latest));
      },
    );
    setControls(this.charts.landscape, [which]);
    this.charts.landscape.show(landscape({ items, name }));
  }

  /** @param {Answers} answers */
  loopCurves({ loops, tests, clutch }) {
    const { loopsOver: over, loopPressure, loopRun } = this.chosen;
    const levels = loopPressures(loops);
    const runs = [...new Map(loops.map((loop) => [loop.run_id, loop])).values()];
    const middle = levels[Math.floor(levels.length / 2)];
    const pressure = loopPressure !== undefined && levels.includes(loopPressure) ? loopPressure : middle;
    const run = runs.some((loop) => loop.run_id === loopRun) ? loopRun : runs[0]?.run_id;
    const redraw = () => this.again((latest) => this.loopCurves(latest));
    const axis = choice("Colour by", BY, over, (value) => {
      this.chosen.loopsOver = value === "pressure" ? "pressure" : "state";
      redraw();
    });
    const level = choice("Pressure", levelOptions(levels), pressure, (value) => {
      this.chosen.loopPressure = Number(value);
      redraw();
    });
    const state = choice("State", stateOptions(runs), run, async (value) => {
      this.chosen.loopRun = value;
      await this.readRun(value);
      redraw();
    });
    setControls(this.charts.loops, loops.length > 0 ? [axis, over === "state" ? level : state] : []);
    this.charts.loops.show(loopCurves({ loops, tests, clutch, channels: this.channels, over, pressure, run }));
  }
}
