// @ts-check
// The tab of the friction loops: torque over speed by state or pressure, and the lag of friction over cycles and pressure.

import { Chart, choice, setControls } from "../charts/chart.js";
import { distinct } from "../charts/columns.js";
import { loopCurves, loopPressures } from "../charts/loops.js";
import { spread } from "../charts/stribeck.js";
import { levelOptions, levelsOf, stateOptions, usual } from "../quantities/choices.js";
import { LAG_NAMES, lagOverCycles, lagOverPressure } from "../quantities/lag.js";
import { Lazy } from "../quantities/lazy.js";
import { QUANTITIES } from "../quantities/names.js";
import { read } from "../shared/api.js";
import { byId, within } from "../shared/dom.js";
import { BY } from "./curves.js";

/** @import { LagName } from "../quantities/lag.js" */
/** @import { DegradationItem, LoopItem, Receipt, StribeckItem } from "../shared/types.js" */
/** @import { Page } from "./clutch.js" */

export class Loops {
  /** @param {Page} page */
  constructor({ reader }) {
    this.reader = reader;
    const { name } = reader;
    this.loops = new Chart({ name, id: "loop-curves", title: "Loops: torque over speed", wide: true, height: 420 });
    this.overCycles = new Chart({ name, id: "lag-cycles", title: "Lag over cycles", height: 400 });
    this.overPressure = new Chart({ name, id: "lag-pressure", title: "Lag over pressure", height: 400 });
    within("loops", ".charts").append(this.loops.element);
    within("lag", ".charts").append(this.overCycles.element, this.overPressure.element);
    /** @type {{ loops: LoopItem[], tests: StribeckItem[], events: Receipt[], lag: DegradationItem[] | null }} */
    this.answers = { loops: [], tests: [], events: [], lag: null };
    /** @type {{ over: "state" | "pressure", pressure?: number, run?: string, lag: LagName, frequency?: number, lagPressure?: number }} */
    this.chosen = { over: "state", lag: "loop_area" };
    this.lags = new Lazy(byId("lag"), [this.overCycles, this.overPressure], () => this.readLag());
  }

  async show() {
    const { reader } = this;
    const [loops, tests, events] = await Promise.all([reader.loops(), reader.tests(), reader.events()]);
    this.answers = { ...this.answers, loops, tests, events };
    this.wantLag();
    await this.readRecords();
    this.draw();
    this.drawLag();
  }

  readRecords() {
    const ids = [...new Set(this.answers.loops.map((loop) => loop.run_id))];
    return this.reader.records([...spread(ids), ids.find((id) => id === this.chosen.run)]);
  }

  draw() {
    const { loops, tests } = this.answers;
    const levels = loopPressures(loops);
    const runs = [...new Map(loops.map((loop) => [loop.run_id, loop])).values()];
    const middle = levels[Math.floor(levels.length / 2)];
    const { over, pressure: chosen } = this.chosen;
    const pressure = chosen !== undefined && levels.includes(chosen) ? chosen : middle;
    const run = runs.some((loop) => loop.run_id === this.chosen.run) ? this.chosen.run : runs[0]?.run_id;
    const axis = choice("Colour by", BY, over, (value) => {
      this.chosen.over = value;
      this.draw();
    });
    const level = choice("Pressure", levelOptions(levels), pressure, (value) => {
      this.chosen.pressure = value;
      this.draw();
    });
    const state = choice("Cycles", stateOptions(runs), run, async (value) => {
      this.chosen.run = value;
      await this.readRecords();
      this.draw();
    });
    setControls(this.loops, loops.length > 0 ? [axis, over === "state" ? level : state] : []);
    const { channels } = this.reader;
    this.loops.show(loopCurves({ loops, tests, clutch: this.reader.present(), channels, over, pressure, run }));
  }

  wantLag() {
    this.lags.want(`${this.reader.present().revision} ${this.chosen.lag}`);
  }

  async readLag() {
    const { lag } = this.chosen;
    /** @type {{ body: { items: DegradationItem[] } }} */
    const { body } = await read(`${this.reader.path}/degradation?quantity=${lag}`);
    if (lag !== this.chosen.lag) return; // another quantity was chosen meanwhile, and is read next
    this.answers.lag = body.items;
    this.drawLag();
  }

  drawLag() {
    const { lag, events } = this.answers;
    const { lag: name } = this.chosen;
    if (lag === null) return;
    const quantity = choice(
      "Quantity",
      LAG_NAMES.map((key) => [key, QUANTITIES[key].title]),
      name,
      (value) => {
        this.chosen.lag = value;
        this.answers.lag = null;
        this.wantLag();
      },
    );
    const frequencies = distinct(lag.flatMap(({ frequency_hz: hz }) => (hz === null ? [] : [hz])));
    const frequency = frequencies.find((hz) => hz === this.chosen.frequency) ?? frequencies[0];
    const items = lag.filter((item) => item.frequency_hz === frequency);
    const pressure = usual(levelsOf(items), this.chosen.lagPressure);
    const hertz = choice(
      "Frequency",
      frequencies.map((hz) => [hz, `${hz} Hz`]),
      frequency,
      (value) => {
        this.chosen.frequency = value;
        this.drawLag();
      },
    );
    const level = choice("Band at", levelOptions(levelsOf(items)), pressure, (value) => {
      this.chosen.lagPressure = value;
      this.drawLag();
    });
    setControls(this.overCycles, items.length > 0 ? [quantity, hertz, level] : [quantity]);
    this.overCycles.show(lagOverCycles({ items, name, pressure, events }));
    this.overPressure.show(lagOverPressure({ items, name }));
  }
}
