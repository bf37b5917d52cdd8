// @ts-check
// The section of the measured engagements: their answer of the API goes in, two charts and the choices above them come out.
// Open this file first, then charts.js, which says what the charts show: an indicator over the life, and one engagement
// beside what the tracked model gives for the same pressure and drive.

import { Chart, choice, setControls } from "../charts/chart.js";
import { clutchPath, Problem, read } from "../shared/api.js";
import { fixed } from "../shared/format.js";
import { INDICATORS } from "../quantities/names.js";
import { CHANNELS, engagementTrace, indicatorOverLife } from "./charts.js";

/** @import { EngagementOut, Receipt } from "../shared/types.js" */
/** @import { Channel, Indicator } from "./charts.js" */

/** @type {Pick<EngagementOut, "measured" | "compared">} */
const NOTHING = { measured: [], compared: null };

/**
 * @template {string} Name
 * @param {Record<Name, string[]>} names
 * @param {string} value
 * @param {Name} usual
 * @returns {Name}
 */
const among = (names, value, usual) => (value in names ? /** @type {Name} */ (value) : usual);

export class Engagements {
  /**
   * @param {string} clutchId
   * @param {() => string} name the start of saved files' names
   * @param {HTMLElement} place where the charts go
   */
  constructor(clutchId, name, place) {
    this.clutchId = clutchId;
    this.overLife = new Chart({ name, id: "engagement-indicators", title: "An indicator over cycles", height: 400 });
    this.trace = new Chart({ name, id: "engagement-trace", title: "An engagement against the model", height: 400 });
    place.append(this.overLife.element, this.trace.element);
    this.answer = NOTHING;
    /** @type {Receipt[]} */
    this.events = [];
    /** @type {Indicator} */
    this.indicator = "stop_time_s";
    /** @type {Channel} */
    this.channel = "torque_nm";
    /** @type {string | undefined} */
    this.run = undefined;
  }

  /**
   * @param {Receipt[]} runs that count
   * @param {Receipt[]} events
   */
  async show(runs, events) {
    this.events = events;
    const evaluated = runs.filter((run) => run.engagement?.status === "determined");
    if (!evaluated.some((run) => run.run_id === this.run)) this.run = undefined;
    this.answer = evaluated.length > 0 ? await this.read() : NOTHING;
    this.drawOverLife();
    this.drawTrace();
  }

  /** The answer; without a stationary test there is no model and none. */
  async read() {
    const run = this.run === undefined ? "" : `?run_id=${encodeURIComponent(this.run)}`;
    try {
      /** @type {{ body: EngagementOut }} */
      const { body } = await read(`${clutchPath(this.clutchId)}/engagement${run}`);
      return body;
    } catch (problem) {
      if (problem instanceof Problem && problem.status === 404) return NOTHING;
      throw problem;
    }
  }

  drawOverLife() {
    const { measured } = this.answer;
    const names = Object.entries(INDICATORS).map(([key, [title]]) => /** @type {[string, string]} */ ([key, title]));
    const which = choice("Indicator", names, this.indicator, (value) => {
      this.indicator = among(INDICATORS, value, this.indicator);
      this.drawOverLife();
    });
    setControls(this.overLife, measured.length > 0 ? [which] : []);
    this.overLife.show(indicatorOverLife({ measured, events: this.events, name: this.indicator }));
  }

  drawTrace() {
    const { measured, compared } = this.answer;
    const names = Object.entries(CHANNELS).map(([key, [title]]) => /** @type {[string, string]} */ ([key, title]));
    const which = choice("Channel", names, this.channel, (value) => {
      this.channel = among(CHANNELS, value, this.channel);
      this.drawTrace();
    });
    /** @type {[string, string][]} */
    const states = measured.map((engagement) => [engagement.run_id, `${fixed(engagement.cycles)} cycles`]);
    const state = choice("Cycles", states, compared?.run_id, async (value) => {
      this.run = value;
      this.answer = await this.read();
      this.drawTrace();
    });
    setControls(this.trace, compared === null ? [] : [which, state]);
    this.trace.show(engagementTrace({ compared, name: this.channel }));
  }
}
