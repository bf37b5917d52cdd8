// The tab of the Stribeck curves: curves by state or pressure, as isolines, and their four parameters over cycles and pressure.

import { Chart, chartsOf, chooser, setControls } from "../charts/chart.js";
import { levelsOf } from "../charts/columns.js";
import { landscape, parameter, PARAMETER_NAMES, PARAMETERS } from "../charts/parameters.js";
import { flat, spread, surface } from "../charts/stribeck.js";
import { levelOptions, ofRun, optionsOf, stateOptions, usual } from "../quantities/names.js";
import { pressureLaw } from "../quantities/pressure_laws.js";
import { section } from "../shared/dom.js";

/** @import { ParameterName } from "../charts/parameters.js" */
/** @import { Depth } from "../charts/stribeck.js" */
/** @import { Page, Tab } from "./clutch.js" */

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
/** @typedef {{ pressure?: number, run?: string, by: "state" | "pressure", over: Depth }} OfCurves */
/** @typedef {OfCurves & { cut?: string, lawRun?: string, parameter: ParameterName, law: ParameterName, parameterCut?: string }} Chosen */

const NAMES = optionsOf(PARAMETERS);

/** @type {(place: HTMLElement, page: Page) => Tab} */
export function curvesTab(place, { reader }) {
  const curves = new Chart({ id: "stribeck", title: "Stribeck curves", wide: true, height: 400 });
  const spatial = new Chart({ id: "surface", title: "Lines of equal torque", wide: true, height: 400 });
  const parameters = PARAMETER_NAMES.map((key) => {
    const { title, symbol: letter } = PARAMETERS[key];
    return { key, chart: new Chart({ id: key.replaceAll("_", "-"), title, letter, height: 300 }) };
  });
  const overAll = { id: "landscape", title: "A parameter over cycles and pressure", wide: true };
  const whole = new Chart({ ...overAll, height: 400 });
  const law = new Chart({ id: "pressure-law", title: "A parameter over pressure", height: 360 });
  const below = [...parameters.map(({ chart }) => chart), whole, law];
  place.append(
    section("stribeck", "Stribeck curves", chartsOf(curves, spatial)),
    section("parameters", "Stribeck parameters", chartsOf(...below)),
  );
  /** @type {{ tests: StribeckItem[], items: DegradationItem[], events: Receipt[] }} */
  let answers = { tests: [], items: [], events: [] };
  /** @type {Chosen} */
  const chosen = { by: "state", over: "pressure", parameter: "static_torque_nm", law: "static_torque_nm" };
  const choose = chooser(chosen, (what) => {
    if (["pressure", "run", "by", "over", "cut"].includes(what)) drawCurves();
    if (["pressure", "lawRun", "parameter", "law", "parameterCut"].includes(what)) drawParameters();
  });
  /** @type {(name: "cut" | "parameterCut", spec: Spec) => HTMLElement[]} */
  const cutsOf = (name, { cuts }) => (cuts ? [choose(name, "Cut at", cuts.options, cuts.chosen)] : []);
  const levels = () => levelsOf(answers.tests.flatMap(({ fits }) => fits));
  const pressure = () => usual(levels(), chosen.pressure);
  const level = () => choose("pressure", "Pressure", levelOptions(levels()), pressure());

  async function drawCurves() {
    const ids = answers.tests.map((test) => test.run_id);
    const onSurface = chosen.over === "cycles" ? spread(ids, MAX_ON_SURFACE) : [];
    await reader.records([...spread(ids), ...onSurface, ids.find((id) => id === chosen.run)]);
    const { tests } = answers;
    const { over, by } = chosen; // another one may be chosen by now
    const run = ofRun(tests, chosen.run)?.run_id;
    const shared = { tests, clutch: reader.present(), channels: reader.channels, pressure: pressure(), run };
    const state = () => choose("run", "Cycles", stateOptions(tests), run);
    const more = { pressure: [state], states: [], cycles: [level] }[over];
    const present = tests.length > 0;
    setControls(curves, present ? [choose("by", "Colour by", BY), by === "state" ? level() : state()] : []);
    curves.show(flat({ ...shared, by }));
    const lines = surface({ ...shared, over, cut: chosen.cut });
    const controls = () => [choose("over", "Torque over speed and", DEPTHS), ...more.map((each) => each())];
    setControls(spatial, present ? [...controls(), ...cutsOf("cut", lines)] : []);
    spatial.show(lines);
  }

  function drawParameters() {
    const { items, events, tests } = answers;
    for (const { key, chart } of parameters) {
      setControls(chart, tests.length > 0 ? [level()] : []);
      chart.show(parameter({ items, events, name: key, pressure: pressure() }));
    }
    const lines = landscape({ items, name: chosen.parameter, cut: chosen.parameterCut });
    setControls(whole, [choose("parameter", "Parameter", NAMES), ...cutsOf("parameterCut", lines)]);
    whole.show(lines);
    const test = ofRun(tests, chosen.lawRun);
    const state = choose("lawRun", "Cycles", stateOptions(tests), test?.run_id);
    setControls(law, tests.length > 0 ? [choose("law", "Parameter", NAMES), state] : []);
    law.show(pressureLaw({ test, name: chosen.law }));
  }

  return {
    show: async () => {
      const [tests, { items }, events] = await Promise.all([reader.tests(), reader.degradation(), reader.events()]);
      answers = { tests, items, events };
      drawParameters();
      await drawCurves();
    },
  };
}
