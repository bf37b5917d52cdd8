// @ts-check
// The tab of the Stribeck curves: curves by state or pressure, in 3D, and their four parameters over cycles and pressure.

import { Chart, choice, setControls } from "../charts/chart.js";
import { landscape, parameter, PARAMETER_NAMES, PARAMETERS } from "../charts/parameters.js";
import { flat, pressuresOf, spread, surface } from "../charts/stribeck.js";
import { levelOptions, stateOptions, usual } from "../quantities/choices.js";
import { pressureLaw } from "../quantities/pressure_laws.js";
import { within } from "../shared/dom.js";

/** @import { ParameterName } from "../charts/parameters.js" */
/** @import { Depth } from "../charts/stribeck.js" */
/** @import { DegradationItem, Receipt, StribeckItem } from "../shared/types.js" */
/** @import { Page } from "./clutch.js" */

/** Most tests whose records the surface over cycles draws. */
const MAX_ON_SURFACE = 9;
/** @type {["state" | "pressure", string][]} */
export const BY = [
  ["state", "cycles"],
  ["pressure", "pressure"],
];
/** @type {[Depth, string][]} */
const DEPTHS = [
  ["pressure", "pressure"],
  ["states", "pressure, at several cycles"],
  ["cycles", "cycles, at one pressure"],
];
/** @type {[ParameterName, string][]} */
const NAMES = PARAMETER_NAMES.map((key) => [key, PARAMETERS[key].title]);

export class Curves {
  /** @param {Page} page */
  constructor({ reader }) {
    this.reader = reader;
    const { name } = reader;
    this.curves = new Chart({ name, id: "stribeck", title: "Stribeck curves", height: 440 });
    this.surface = new Chart({ name, id: "surface", title: "Stribeck curves in 3D", spatial: true, height: 440 });
    this.parameters = PARAMETER_NAMES.map((key) => {
      const { title, symbol: letter } = PARAMETERS[key];
      return { key, chart: new Chart({ name, id: key.replaceAll("_", "-"), title, letter, height: 300 }) };
    });
    const overAll = { id: "landscape", title: "A parameter over cycles and pressure", spatial: true, wide: true };
    this.landscape = new Chart({ name, ...overAll, height: 440 });
    this.law = new Chart({ name, id: "pressure-law", title: "A parameter over pressure", height: 360 });
    within("stribeck", ".charts").append(this.curves.element, this.surface.element);
    const charts = [...this.parameters.map(({ chart }) => chart), this.landscape, this.law];
    within("parameters", ".charts").append(...charts.map(({ element }) => element));
    /** @type {{ tests: StribeckItem[], items: DegradationItem[], events: Receipt[] }} */
    this.answers = { tests: [], items: [], events: [] };
    /** @type {{ pressure?: number, run?: string, lawRun?: string, by: "state" | "pressure", over: Depth, parameter: ParameterName, law: ParameterName }} */
    this.chosen = { by: "state", over: "pressure", parameter: "static_torque_nm", law: "static_torque_nm" };
  }

  async show() {
    const { reader } = this;
    const [tests, { items }, events] = await Promise.all([reader.tests(), reader.degradation(), reader.events()]);
    this.answers = { tests, items, events };
    this.drawParameters();
    await this.readRecords();
    this.drawCurves();
  }

  /** The records of the tests that are drawn. */
  readRecords() {
    const ids = this.answers.tests.map((test) => test.run_id);
    const spatial = this.chosen.over === "cycles" ? spread(ids, MAX_ON_SURFACE) : [];
    return this.reader.records([...spread(ids), ...spatial, ids.find((id) => id === this.chosen.run)]);
  }

  pressure = () => usual(pressuresOf(this.answers.tests), this.chosen.pressure);

  pressureChoice = () =>
    choice("Pressure", levelOptions(pressuresOf(this.answers.tests)), this.pressure(), (value) => {
      this.chosen.pressure = value;
      this.drawCurves();
      this.drawParameters();
    });

  drawCurves() {
    const { tests } = this.answers;
    const { over, by } = this.chosen;
    const run = tests.some((test) => test.run_id === this.chosen.run) ? this.chosen.run : tests[0]?.run_id;
    const { channels } = this.reader;
    const shared = { tests, clutch: this.reader.present(), channels, pressure: this.pressure(), run };
    const state = () =>
      choice("Cycles", stateOptions(tests), run, async (value) => {
        this.chosen.run = value;
        await this.readRecords();
        this.drawCurves();
      });
    const colour = choice("Colour by", BY, by, (value) => {
      this.chosen.by = value;
      this.drawCurves();
    });
    setControls(this.curves, tests.length > 0 ? [colour, by === "state" ? this.pressureChoice() : state()] : []);
    this.curves.show(flat({ ...shared, by }));
    const axis = choice("Torque over speed and", DEPTHS, over, async (value) => {
      this.chosen.over = value;
      await this.readRecords();
      this.drawCurves();
    });
    const more = { pressure: state, states: null, cycles: this.pressureChoice }[over];
    setControls(this.surface, tests.length > 0 ? [axis, ...(more ? [more()] : [])] : []);
    this.surface.show(surface({ ...shared, over }));
  }

  drawParameters() {
    const { items, events, tests } = this.answers;
    for (const { key, chart } of this.parameters) {
      setControls(chart, tests.length > 0 ? [this.pressureChoice()] : []);
      chart.show(parameter({ items, events, name: key, pressure: this.pressure() }));
    }
    const which = (/** @type {"parameter" | "law"} */ of) =>
      choice("Parameter", NAMES, this.chosen[of], (value) => {
        this.chosen[of] = value;
        this.drawParameters();
      });
    setControls(this.landscape, [which("parameter")]);
    this.landscape.show(landscape({ items, name: this.chosen.parameter }));
    const test = tests.find(({ run_id: id }) => id === this.chosen.lawRun) ?? tests[0];
    const state = choice("Cycles", stateOptions(tests), test?.run_id, (value) => {
      this.chosen.lawRun = value;
      this.drawParameters();
    });
    setControls(this.law, tests.length > 0 ? [which("law"), state] : []);
    this.law.show(pressureLaw({ test, name: this.chosen.law }));
  }
}
