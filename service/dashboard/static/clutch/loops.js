// The tab of the friction loops: torque over speed by state or pressure, and the lag of friction over cycles and pressure.

import { Chart, chartsOf, chooser, setControls } from "../charts/chart.js";
import { distinct, levelsOf } from "../charts/columns.js";
import { loopCurves } from "../charts/loops.js";
import { spread } from "../charts/stribeck.js";
import { LAG_NAMES, lagOverCycles, lagOverPressure } from "../quantities/lag.js";
import { lazy } from "../quantities/lazy.js";
import { levelOptions, ofRun, optionsOf, QUANTITIES, stateOptions, usual } from "../quantities/names.js";
import { read } from "../shared/api.js";
import { offered, section } from "../shared/dom.js";
import { BY } from "./curves.js";

/** @import { LagName } from "../quantities/lag.js" */
/** @import { Page, Tab } from "./clutch.js" */

/** @typedef {{ over: "state" | "pressure", pressure?: number, run?: string }} OfLoops */

const QUANTITY_OPTIONS = optionsOf(QUANTITIES, LAG_NAMES);

/** @type {(place: HTMLElement, page: Page) => Tab} */
export function loopsTab(place, { reader }) {
  const curves = new Chart({ id: "loop-curves", title: "Loops: torque over speed", wide: true, height: 420 });
  const overCycles = new Chart({ id: "lag-cycles", title: "Lag over cycles", height: 400 });
  const overPressure = new Chart({ id: "lag-pressure", title: "Lag over pressure", height: 400 });
  const lagging = section("lag", "Lag of friction over life", chartsOf(overCycles, overPressure));
  place.append(section("loops", "Friction loops", chartsOf(curves)), lagging);
  /** @type {{ loops: LoopItem[], tests: StribeckItem[], events: Receipt[] }} */
  let answers = { loops: [], tests: [], events: [] };
  /** @type {DegradationItem[] | null} null: not read yet */
  let lag = null;
  /** @type {OfLoops & { lag: LagName, frequency?: number, lagPressure?: number }} */
  const chosen = { over: "state", lag: "loop_area" };
  const choose = chooser(chosen, (what) => {
    if (what === "lag") {
      lag = null;
      wantLag();
    } else if (what === "frequency" || what === "lagPressure") drawLag();
    else draw();
  });
  const lookAtLag = lazy(lagging, [overCycles, overPressure], readLag);
  const wantLag = () => lookAtLag(`${reader.present().revision} ${chosen.lag}`);

  async function draw() {
    const ids = [...new Set(answers.loops.map((loop) => loop.run_id))];
    await reader.records([...spread(ids), ids.find((id) => id === chosen.run)]);
    const { loops, tests } = answers;
    const { over } = chosen;
    const levels = levelsOf(loops);
    const pressure = levels.find((level) => level === chosen.pressure) ?? levels[Math.floor(levels.length / 2)];
    const runs = [...new Map(loops.map((loop) => [loop.run_id, loop])).values()];
    const run = ofRun(runs, chosen.run)?.run_id;
    const level = choose("pressure", "Pressure", levelOptions(levels), pressure);
    const state = choose("run", "Cycles", stateOptions(runs), run);
    const controls = [choose("over", "Colour by", BY), over === "state" ? level : state];
    setControls(curves, loops.length > 0 ? controls : []);
    const { channels } = reader;
    curves.show(loopCurves({ loops, tests, clutch: reader.present(), channels, over, pressure, run }));
  }

  async function readLag() {
    const quantity = chosen.lag;
    const { body } = await read(`${reader.path}/degradation?quantity=${quantity}`);
    if (quantity !== chosen.lag) return; // another quantity was chosen meanwhile, and is read next
    lag = body.items;
    drawLag();
  }

  function drawLag() {
    if (lag === null) return;
    const frequencies = distinct(lag.flatMap(({ frequency_hz: hz }) => (hz === null ? [] : [hz])));
    const frequency = frequencies.find((hz) => hz === chosen.frequency) ?? frequencies[0];
    const items = lag.filter((item) => item.frequency_hz === frequency);
    const levels = levelsOf(items);
    const pressure = usual(levels, chosen.lagPressure);
    const quantity = choose("lag", "Quantity", QUANTITY_OPTIONS);
    const hertz = offered(frequencies, (hz) => `${hz} Hz`);
    const more = [
      choose("frequency", "Frequency", hertz, frequency),
      choose("lagPressure", "Band at", levelOptions(levels), pressure),
    ];
    setControls(overCycles, [quantity, ...(items.length > 0 ? more : [])]);
    overCycles.show(lagOverCycles({ items, name: chosen.lag, pressure, events: answers.events }));
    overPressure.show(lagOverPressure({ items, name: chosen.lag }));
  }

  return {
    show: async () => {
      const [loops, tests, events] = await Promise.all([reader.loops(), reader.tests(), reader.events()]);
      answers = { loops, tests, events };
      wantLag();
      await draw();
      drawLag();
    },
  };
}
