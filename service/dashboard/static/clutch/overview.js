// @ts-check
// The first tab: runs that wait for someone, the state in figures, the forecast with its safe bound, mean COF beside the shudder
// margin, and what limits the life first.

import { Chart, choice, setControls } from "../charts/chart.js";
import { fan } from "../charts/fan.js";
import { meanCof } from "../charts/life.js";
import { levelOptions, levelsOf, usual } from "../quantities/choices.js";
import { criteriaTable } from "../quantities/criteria.js";
import { Lazy } from "../quantities/lazy.js";
import { RemainingBy } from "../quantities/remaining.js";
import { shudderMargin } from "../quantities/shudder.js";
import { read } from "../shared/api.js";
import { h } from "../shared/dom.js";
import { atLeast, estimate, fixed, likely, percent, probability, roundedDown } from "../shared/format.js";
import { healthBar } from "../shared/sparkline.js";
import { firstRun } from "../shared/welcome.js";
import { heldView } from "./warnings.js";
import { PlannedDuty } from "./planned_duty.js";
import { lifeWarnings, warningsView } from "./warnings.js";

/** @import { Content } from "../shared/dom.js" */
/** @import { ClutchOut, CourseShare, CriterionOutcome, DegradationItem, Receipt, RemainingLife } from "../shared/types.js" */
/** @import { Page } from "./clutch.js" */

export class Overview {
  /**
   * @param {HTMLElement} place
   * @param {Page} page
   */
  constructor(place, page) {
    const { reader } = page;
    this.page = page;
    this.reader = reader;
    const { name } = reader;
    this.fan = new Chart({ name, id: "fan", title: "Mean COF against its threshold", wide: true, height: 330 });
    this.cof = new Chart({ name, id: "cof", title: "Mean COF by pressure", height: 270 });
    this.shudder = new Chart({ name, id: "shudder", title: "Shudder margin", height: 270 });
    this.top = h("div", {});
    this.tiles = h("dl", { class: "tiles" });
    this.limits = h("div", {});
    const charts = h("div", { class: "charts" }, this.fan.element, this.cof.element, this.shudder.element);
    const more = h("div", { class: "more" });
    const title = h("h2", { class: "hidden" }, "Overview");
    this.body = h("div", { hidden: true }, title, this.tiles, this.limits, charts, more);
    place.append(this.top, this.body);
    this.planned = new PlannedDuty(more, reader.id);
    this.by = new RemainingBy(more, reader.id);
    /** @type {{ slopes: DegradationItem[] | null, limits: CriterionOutcome[] | null }} null: not computed yet */
    this.tracked = { slopes: null, limits: null };
    /** @type {number | undefined} bar */
    this.level = undefined;
    /** @type {Receipt[]} */
    this.events = [];
    this.slopes = new Lazy(this.shudder.element, [this.shudder], () => this.readSlopes());
  }

  async show() {
    const { reader } = this;
    const clutch = reader.present();
    const held = clutch.held > 0 ? (await reader.held()).reverse() : [];
    const heldPart = held.length > 0 && h("section", { id: "held" }, heldView(held, this.page));
    this.body.hidden = clutch.runs === 0;
    if (clutch.runs === 0) {
      const first = clutch.held === 0 && h("div", { id: "first" }, firstRun(clutch.clutch_id));
      this.top.replaceChildren(...[heldPart, first].filter((part) => part !== false));
      return;
    }
    // figures first: what takes the service longer follows
    this.top.replaceChildren(...(heldPart ? [heldPart] : []));
    const life = await reader.life();
    this.tiles.replaceChildren(...tiles(clutch, life));
    this.limits.replaceChildren(...criteriaTable(life));
    const [tests, events] = await Promise.all([reader.tests(), reader.events()]);
    this.events = events;
    this.cof.show(meanCof({ tests, events }));
    this.by.show({ life, tests, loops: reader.loops });
    this.slopes.want(`${life.revision} ${this.level}`);
    const [{ life: shown, pooled, predictions }, degradation] = await Promise.all([
      reader.forecast(),
      reader.degradation(),
    ]);
    // what held runs would change, the remaining life says
    const further = degradation.warnings.filter(({ code }) => code !== "held_runs");
    const odd = lifeWarnings({ warned: [...life.warnings, ...further], tests });
    const warned = odd.length > 0 && h("section", { id: "warnings" }, warningsView(odd));
    this.top.replaceChildren(...[heldPart, warned].filter((part) => part !== false));
    this.fan.show(fan({ life: shown, pooled, predictions, events }));
    this.drawShudder();
  }

  /** The slopes are shown as soon as they are there; when they reach their limit is computed after that. */
  async readSlopes() {
    /** @type {{ body: { items: DegradationItem[] } }} */
    const { body } = await read(`${this.reader.path}/degradation?quantity=slope`);
    this.tracked = { slopes: body.items, limits: null };
    this.drawShudder();
    const level = this.slopeLevel();
    if (level === undefined) return;
    const life = await this.reader.life();
    const own = life.criteria.filter((end) => end.quantity === "slope" && end.pressure_bar === level);
    const limits = own.length > 0 ? own : await this.readLimits(level);
    if (level !== this.slopeLevel()) return; // another pressure was chosen meanwhile, and is read next
    this.tracked = { ...this.tracked, limits };
    this.drawShudder();
  }

  /** @param {number} level bar */
  async readLimits(level) {
    /** @type {{ body: RemainingLife }} */
    const { body } = await read(`${this.reader.path}/remaining-useful-life?quantity=slope&pressure_bar=${level}`);
    return body.criteria;
  }

  slopeLevel = () => usual(levelsOf(this.tracked.slopes ?? []), this.level);

  drawShudder() {
    const { slopes, limits } = this.tracked;
    if (slopes === null) return;
    const pressure = this.slopeLevel();
    const level = choice("Pressure", levelOptions(levelsOf(slopes)), pressure, async (value) => {
      this.level = value;
      this.tracked.limits = null;
      this.drawShudder();
      this.slopes.want(`${(await this.reader.life()).revision} ${this.level}`);
    });
    setControls(this.shudder, slopes.length > 0 ? [level] : []);
    const items = slopes.filter((item) => item.pressure_bar === pressure);
    this.shudder.show(shudderMargin({ items, limits, events: this.events }));
  }
}

/** @type {(clutch: ClutchOut, life: RemainingLife) => HTMLElement[]} */
function tiles(clutch, life) {
  const { current, model, course } = life;
  const { health } = current;
  const [cof, deviation] = estimate(current.mean_cof, current.mean_cof_sd).split(" ± ");
  const share = current.fraction_of_initial;
  const place = share === null ? `at ${fixed(current.measured_at_cycles)} cycles` : `${percent(share, 1)} of new`;
  const used = `${life.runs_used} ${life.runs_used === 1 ? "test" : "tests"} used, ${clutch.runs} runs`;
  const sure = course ? `${probability(course.probability)} sure` : life.runs_used > 2 ? "" : "after three tests";
  return [
    tile("Health", percent(health), health === null ? null : healthBar(health, clutch.state.name)),
    tile(predicts(life) ? "Safe for, cycles (95 %)" : "Remaining cycles", remaining(life), small(remainingNotes(life))),
    tile("Mean COF", cof, small(`${deviation ? `± ${deviation}; ` : ""}${place}`)),
    tile("Duty cycles so far", fixed(life.as_of_cycles), small(used)),
    tile("How it ages", course ? COURSES[course.name] : "not known yet", small(sure)),
    tile(
      "Correction",
      model.effects.length > 0 ? `For ${model.effects.map((name) => name.replaceAll("_", " ")).join(", ")}` : "None",
      small(model.effects.length > 0 ? "by the adopted diagnosis" : "no diagnosis is adopted"),
    ),
  ];
}

/** @type {Record<CourseShare["name"], string>} */
const COURSES = { eq6: "As expected", slowing: "Slower and slower", accelerating: "Faster and faster" };

/** @type {(life: RemainingLife) => string} */
function remainingNotes(life) {
  const { status, ended, held_runs: held, back_cast: cast, ended_lives: lives, probability_of_reaching: chance } = life;
  const never = chance !== null && chance < 0.995 && status !== "insufficient_data";
  return [
    ended ? `ended at ${fixed(ended.cycles)} cycles` : null,
    status === "reached" ? life.statement : null,
    status === "insufficient_data" ? atLeast(life.at_least) : null,
    status === "may_never_reach" ? "the tests do not show the end yet" : null,
    predicts(life) ? likely(life.remaining_cycles) : null,
    never ? `${probability(chance)} chance of an end within ${fixed(life.horizon_cycles)} cycles` : null,
    held ? `if the held ${held.count === 1 ? "run counts" : "runs count"}: ${likely(held.remaining_cycles)}` : null,
    cast && cast.of > 0 ? `${cast.held} of ${cast.of} later tests lay inside their forecast` : null,
    lives > 0 ? `calibrated on ${lives} ended ${lives === 1 ? "life" : "lives"}` : null,
  ]
    .filter((note) => note !== null)
    .join("; ");
}

/** @param {string} text */
const small = (text) => h("small", {}, text);

/** @type {(name: string, value: string, more: Content) => HTMLElement} */
const tile = (name, value, more) =>
  h("div", { class: "tile" }, h("dt", {}, name), h("dd", {}, h("span", { class: "big" }, value), more));

/** @param {RemainingLife} life */
const predicts = ({ status }) => status === "predicted" || status === "may_never_reach";

/** @param {RemainingLife} life */
function remaining({ status, at_least: bound, ended }) {
  if (ended) return ended.reason === "worn" ? "0" : "–";
  if (status === "insufficient_data") return "–";
  return status === "reached" ? "0" : roundedDown(bound ?? 0);
}
