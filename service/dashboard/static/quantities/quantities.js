// @ts-check
// What a clutch's page shows of quantities other than mean COF: its criteria, the shudder margin, the lag, the pressure laws.
// Open this file first, then shudder.js, lag.js and pressure_laws.js, which say what the charts show, and criteria.js; lazy.js
// reads an answer that takes seconds when its section is looked at, and again only when the clutch has changed.

import { Chart, choice, setControls } from "../charts/chart.js";
import { distinct } from "../charts/columns.js";
import { PARAMETER_NAMES, PARAMETERS } from "../charts/parameters.js";
import { clutchPath, read } from "../shared/api.js";
import { levelOptions, levelsOf, stateOptions, usual } from "./choices.js";
import { LAG, LAG_NAMES, lagOverCycles, lagOverPressure } from "./lag.js";
import { Lazy } from "./lazy.js";
import { pressureLaw } from "./pressure_laws.js";
import { shudderMargin } from "./shudder.js";

/** @import { ParameterName } from "../charts/parameters.js" */
/** @import { CriterionOutcome, DegradationItem, Receipt, RemainingLife, StribeckItem } from "../shared/types.js" */
/** @import { LagName } from "./lag.js" */

/**
 * @typedef {object} Answers what the page has read of the clutch
 * @property {RemainingLife | null} life
 * @property {StribeckItem[]} tests
 * @property {Receipt[]} events
 */

/**
 * @typedef {object} Choices
 * @property {number} [slopePressure] bar
 * @property {LagName} lag
 * @property {number} [frequency] Hz
 * @property {number} [lagPressure] bar
 * @property {ParameterName} parameter
 * @property {string} [run]
 */

/**
 * @typedef {object} Tracked what has been computed so far, null where it has not been
 * @property {DegradationItem[] | null} slopes
 * @property {CriterionOutcome[] | null} limits of slopes at the chosen pressure
 * @property {DegradationItem[] | null} lag of the chosen quantity
 */

export class Quantities {
  /**
   * @param {string} clutchId
   * @param {() => string} name the start of saved files' names
   * @param {(section: string) => HTMLElement} place where a section's charts go
   */
  constructor(clutchId, name, place) {
    /** @type {(section: string, options: Omit<import("../charts/chart.js").Options, "name">) => Chart} */
    const add = (section, options) => {
      const chart = new Chart({ name, ...options });
      place(section).append(chart.element);
      return chart;
    };
    this.shudder = add("shudder", { id: "shudder", title: "Slope of friction over speed", wide: true, height: 400 });
    this.overCycles = add("lag", { id: "lag-cycles", title: "Lag over cycles", height: 400 });
    this.overPressure = add("lag", { id: "lag-pressure", title: "Lag over pressure", height: 400 });
    this.law = add("parameters", { id: "pressure-law", title: "A parameter over pressure", height: 360 });
    this.path = clutchPath(clutchId);
    /** @type {Answers} */
    this.answers = { life: null, tests: [], events: [] };
    /** @type {Choices} */
    this.chosen = { lag: "loop_area", parameter: "static_torque_nm" };
    /** @type {Tracked} */
    this.tracked = { slopes: null, limits: null, lag: null };
    this.slopes = new Lazy(place("shudder"), [this.shudder], () => this.readSlopes());
    this.lags = new Lazy(place("lag"), [this.overCycles, this.overPressure], () => this.readLag());
  }

  /** @param {Answers} answers */
  show(answers) {
    this.answers = answers;
    this.drawLaw();
    this.drawShudder();
    this.drawLag();
    this.wantSlopes();
    this.wantLag();
  }

  wantSlopes() {
    this.slopes.want(`${this.answers.life?.revision} ${this.chosen.slopePressure}`);
  }

  wantLag() {
    this.lags.want(`${this.answers.life?.revision} ${this.chosen.lag}`);
  }

  /**
   * The tracks of a quantity, computed by the service where it has not been yet.
   * @param {string} quantity
   * @returns {Promise<DegradationItem[]>}
   */
  async tracks(quantity) {
    /** @type {{ body: { items: DegradationItem[] } }} */
    const { body } = await read(`${this.path}/degradation?quantity=${quantity}`);
    return body.items;
  }

  /** The slopes are shown as soon as they are there; when they reach their limit is computed after that. */
  async readSlopes() {
    const slopes = await this.tracks("slope");
    this.tracked = { ...this.tracked, slopes, limits: null };
    this.drawShudder();
    const level = this.slopePressure();
    if (level === undefined) return;
    const own = this.answers.life?.criteria.filter((end) => end.quantity === "slope" && end.pressure_bar === level);
    const limits = own && own.length > 0 ? own : await this.readLimits(level);
    if (level !== this.slopePressure()) return; // another pressure was chosen meanwhile, and is read next
    this.tracked = { ...this.tracked, limits };
    this.drawShudder();
  }

  /** @param {number} level bar */
  async readLimits(level) {
    /** @type {{ body: RemainingLife }} */
    const { body } = await read(`${this.path}/remaining-useful-life?quantity=slope&pressure_bar=${level}`);
    return body.criteria;
  }

  async readLag() {
    const { lag } = this.chosen;
    const items = await this.tracks(lag);
    if (lag !== this.chosen.lag) return; // another quantity was chosen meanwhile, and is read next
    this.tracked = { ...this.tracked, lag: items };
    this.drawLag();
  }

  /** The chosen pressure of slopes, or the one closest to the usual; undefined where there are none. */
  slopePressure() {
    return usual(levelsOf(this.tracked.slopes ?? []), this.chosen.slopePressure);
  }

  drawShudder() {
    const { slopes, limits } = this.tracked;
    if (slopes === null) return;
    const pressure = this.slopePressure();
    const level = choice("Pressure", levelOptions(levelsOf(slopes)), pressure, (value) => {
      this.chosen.slopePressure = Number(value);
      this.tracked = { ...this.tracked, limits: null };
      this.drawShudder();
      this.wantSlopes();
    });
    setControls(this.shudder, slopes.length > 0 ? [level] : []);
    const items = slopes.filter((item) => item.pressure_bar === pressure);
    this.shudder.show(shudderMargin({ items, limits, events: this.answers.events }));
  }

  drawLag() {
    const { lag: name } = this.chosen;
    const quantity = choice(
      "Quantity",
      LAG_NAMES.map((key) => [key, LAG[key].title]),
      name,
      (value) => {
        this.chosen.lag = LAG_NAMES.find((key) => key === value) ?? name;
        this.tracked = { ...this.tracked, lag: null };
        this.wantLag();
      },
    );
    const { lag } = this.tracked;
    if (lag === null) return;
    const frequencies = distinct(lag.flatMap(({ frequency_hz: hz }) => (hz === null ? [] : [hz])));
    const frequency = frequencies.find((hz) => hz === this.chosen.frequency) ?? frequencies[0];
    const items = lag.filter((item) => item.frequency_hz === frequency);
    const pressure = usual(levelsOf(items), this.chosen.lagPressure);
    const hertz = choice("Frequency", frequencies.map(hertzOption), frequency, (value) => {
      this.chosen.frequency = Number(value);
      this.drawLag();
    });
    const level = choice("Band at", levelOptions(levelsOf(items)), pressure, (value) => {
      this.chosen.lagPressure = Number(value);
      this.drawLag();
    });
    setControls(this.overCycles, items.length > 0 ? [quantity, hertz, level] : [quantity]);
    this.overCycles.show(lagOverCycles({ items, name, pressure, events: this.answers.events }));
    this.overPressure.show(lagOverPressure({ items, name }));
  }

  drawLaw() {
    const { tests } = this.answers;
    const { parameter: name } = this.chosen;
    const test = tests.find(({ run_id: id }) => id === this.chosen.run) ?? tests[0];
    const which = choice(
      "Parameter",
      PARAMETER_NAMES.map((key) => [key, PARAMETERS[key].title]),
      name,
      (value) => {
        this.chosen.parameter = PARAMETER_NAMES.find((key) => key === value) ?? name;
        this.drawLaw();
      },
    );
    const state = choice("State", stateOptions(tests), test?.run_id, (value) => {
      this.chosen.run = value;
      this.drawLaw();
    });
    setControls(this.law, tests.length > 0 ? [which, state] : []);
    this.law.show(pressureLaw({ test, name }));
  }
}

/**
 * @param {number} frequency
 * @returns {[number, string]}
 */
const hertzOption = (frequency) => [frequency, `${frequency} Hz`];
