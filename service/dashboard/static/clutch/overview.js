// The first tab: runs that wait for someone, the state in figures, the forecast with its safe bound, mean COF beside the shudder
// margin, and what limits the life first.

import { Chart, chartsOf, chooser, setControls } from "../charts/chart.js";
import { levelsOf } from "../charts/columns.js";
import { fan } from "../charts/fan.js";
import { meanCof } from "../charts/life.js";
import { levelOptions, usual } from "../quantities/names.js";
import { criteriaTable, predicts } from "../quantities/criteria.js";
import { lazy } from "../quantities/lazy.js";
import { remainingBy } from "../quantities/remaining.js";
import { shudderMargin } from "../quantities/shudder.js";
import { read } from "../shared/api.js";
import { h } from "../shared/dom.js";
import { atLeast, counted, estimate, fixed, likely, percent, probability, roundedDown } from "../shared/format.js";
import { shareBar } from "../shared/sparkline.js";
import { colourOf } from "../shared/state.js";
import { firstRun } from "../shared/welcome.js";
import { plannedDuty } from "./planned_duty.js";
import { heldView, warningsView } from "./warnings.js";

/** @import { Content } from "../shared/dom.js" */
/** @import { Page, Tab } from "./clutch.js" */

/** @type {(place: HTMLElement, page: Page) => Tab} */
export function overviewTab(place, page) {
  const { reader } = page;
  const forecast = new Chart({ id: "fan", title: "Mean COF against its threshold", wide: true, height: 330 });
  const cof = new Chart({ id: "cof", title: "Mean COF by pressure", height: 270 });
  const shudder = new Chart({ id: "shudder", title: "Shudder margin", height: 270 });
  const top = h("div");
  const figures = h("dl.tiles");
  const limits = h("div");
  const charts = chartsOf(forecast, cof, shudder);
  const more = h("div.more");
  const body = h("div", { hidden: true }, h("h2.hidden", "Overview"), figures, limits, charts, more);
  place.append(top, body);
  plannedDuty(more, reader.path);
  const showRemaining = remainingBy(more, reader);
  /** @type {{ slopes: DegradationItem[] | null, limits: CriterionOutcome[] | null, counts: boolean }} null: not computed yet */
  let tracked = { slopes: null, limits: null, counts: false };
  /** @type {{ level?: number }} bar */
  const chosen = {};
  /** @type {Receipt[]} */
  let events = [];
  const lookAtSlopes = lazy(shudder.element, [shudder], readSlopes);
  const wantSlopes = async () => lookAtSlopes(`${(await reader.life()).revision} ${chosen.level}`);
  const choose = chooser(chosen, () => {
    tracked.limits = null;
    drawShudder();
    wantSlopes();
  });

  async function show() {
    const clutch = reader.present();
    const held = clutch.held > 0 ? (await reader.held()).reverse() : [];
    const parts = held.length > 0 ? [h("section", { id: "held" }, heldView(held, page))] : [];
    body.hidden = clutch.runs === 0;
    if (clutch.runs === 0 && clutch.held === 0) parts.push(h("div", { id: "first" }, firstRun(clutch.clutch_id)));
    top.replaceChildren(...parts); // figures first: what takes the service longer follows
    if (clutch.runs === 0) return;
    const life = await reader.life();
    figures.replaceChildren(...tiles(clutch, life));
    limits.replaceChildren(...criteriaTable(life));
    const [tests, marks] = await Promise.all([reader.tests(), reader.events()]);
    events = marks;
    cof.show(meanCof({ tests, events }));
    showRemaining(life, tests);
    wantSlopes();
    const [shown, degradation] = await Promise.all([reader.forecast(), reader.degradation()]);
    // what held runs would change, the remaining life says
    const further = degradation.warnings.filter(({ code }) => code !== "held_runs");
    const odd = [...life.warnings, ...further];
    top.replaceChildren(...parts, odd.length > 0 ? h("section", { id: "warnings" }, warningsView(odd, tests)) : "");
    forecast.show(fan(shown));
    drawShudder();
  }

  /** The slopes are shown as soon as they are there; when they reach their limit is computed after that. */
  async function readSlopes() {
    const { body } = await read(`${reader.path}/degradation?quantity=slope`);
    tracked = { slopes: body.items, limits: null, counts: false };
    drawShudder();
    const level = slopeLevel();
    if (level === undefined) return;
    const { criteria } = await reader.life();
    const own = criteria.filter((end) => end.quantity === "slope" && end.pressure_bar === level);
    const found = own.length > 0 ? own : await readLimits(level);
    if (level !== slopeLevel()) return; // another pressure was chosen meanwhile, and is read next
    tracked.limits = found;
    tracked.counts = own.length > 0;
    drawShudder();
  }

  /** @param {number} level bar */
  const readLimits = async (level) =>
    (await read(`${reader.path}/remaining-useful-life?quantity=slope&pressure_bar=${level}`)).body.criteria;

  const slopeLevel = () => usual(levelsOf(tracked.slopes ?? []), chosen.level);

  function drawShudder() {
    const { slopes: all, limits: found, counts } = tracked;
    if (all === null) return;
    const pressure = slopeLevel();
    setControls(shudder, all.length > 0 ? [choose("level", "Pressure", levelOptions(levelsOf(all)), pressure)] : []);
    const items = all.filter((item) => item.pressure_bar === pressure);
    shudder.show(shudderMargin({ items, limits: found, counts, events }));
  }

  return { show, charts: [forecast, shudder] };
}

/** @type {(clutch: ClutchOut, life: RemainingLife) => HTMLElement[]} */
function tiles(clutch, life) {
  const { current, model, course } = life;
  const { health } = current;
  const [cof, deviation] = estimate(current.mean_cof, current.mean_cof_sd).split(" ± ");
  const share = current.fraction_of_initial;
  const place = share === null ? `at ${fixed(current.measured_at_cycles)} cycles` : `${percent(share, 1)} of new`;
  const last = share !== null && clutch.recent?.mean_cof.at(-1);
  const used = `${counted(life.runs_used, "test")} used, ${counted(clutch.runs, "run")}`;
  const sure = course ? `${probability(course.probability)} sure` : life.runs_used > 2 ? "" : "after three tests";
  const corrected = model.effects.map((name) => name.replaceAll("_", " ")).join(", ");
  const look = { class: "health", style: colourOf(clutch.state.name) };
  return [
    tile("Health", percent(health), health === null ? null : shareBar(health, look)),
    tile(predicts(life) ? "Safe for, cycles (95 %)" : "Remaining cycles", remaining(life), remainingNotes(life)),
    tile(share === null ? "Mean COF, measured" : "Mean COF, tracked", cof, [
      deviation && `± ${deviation}; `,
      place,
      last ? `; last test ${fixed(last, 4)}` : "",
    ]),
    tile("Duty cycles so far", fixed(life.as_of_cycles), used),
    tile("How it ages", course ? COURSES[course.name] : "not known yet", sure),
    corrected
      ? tile("Correction", `For ${corrected}`, "by the adopted diagnosis")
      : tile("Correction", "None", "no diagnosis is adopted"),
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
    lives > 0 ? `calibrated on ${counted(lives, "ended life", "ended lives")}` : null,
  ]
    .filter((note) => note !== null)
    .join("; ");
}

/** @type {(name: string, value: string, more: Content) => HTMLElement} */
const tile = (name, value, more) => h("div.tile", h("dt", name), h("dd", h("span.big", value), h("small", more)));

/** @param {RemainingLife} life */
function remaining({ status, at_least: bound, ended }) {
  if (ended) return ended.reason === "worn" ? "0" : "–";
  if (status === "insufficient_data") return "–";
  return status === "reached" ? "0" : roundedDown(bound ?? 0);
}
