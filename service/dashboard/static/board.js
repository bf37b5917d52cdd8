// The clutch page's charts and the choices that stand above them.

import { clutchPath, read } from "./api.js";
import { Chart, choice } from "./chart.js";
import { fan, foretelling, meanCof } from "./charts_life.js";
import { loopAreas, loopCurves, loopPressures } from "./charts_loops.js";
import { landscape, parameter, PARAMETERS } from "./charts_parameters.js";
import { flat, pressuresOf, spread, surface } from "./charts_stribeck.js";
import { fixed } from "./format.js";

/** Makes the charts; `life` and `rest` show what is known. */
export function board(clutchId, name, place) {
  const add = (section, options) => {
    const chart = new Chart({ name, ...options });
    place(section).append(chart.element);
    return chart;
  };
  const charts = {
    fan: add("life", { id: "fan", title: "Mean COF against its threshold", wide: true, height: 420 }),
    foretelling: add("life", { id: "foretold", title: "Remaining cycles, as foretold" }),
    cof: add("life", { id: "cof", title: "Mean COF by pressure" }),
    flat: add("stribeck", { id: "stribeck", title: "Stribeck curves by state", height: 440 }),
    surface: add("stribeck", { id: "surface", title: "Stribeck curves in 3D", spatial: true, height: 440 }),
    ...Object.fromEntries(Object.entries(PARAMETERS).map(([key, { title, symbol }]) => [key, add("parameters", { id: key.replaceAll("_", "-"), title, letter: symbol, height: 300 })])),
    landscape: add("parameters", { id: "landscape", title: "A parameter over cycles and pressure", spatial: true, wide: true, height: 440 }),
    loops: add("loops", { id: "loop-curves", title: "Loops: torque over speed", height: 400 }),
    areas: add("loops", { id: "loop-areas", title: "Loop area over cycles", height: 400 }),
  };
  return new Board(clutchId, charts);
}

class Board {
  constructor(clutchId, charts) {
    Object.assign(this, { clutchId, charts, data: null, channels: {}, chosen: { over: "pressure", loopsOver: "state", parameter: "static_torque_nm" } });
  }

  life({ life, items, foretold, tests, events }) {
    const pooled = items.find((item) => item.quantity === "mean_cof" && item.pressure_bar === null);
    this.charts.foretelling.show(foretelling({ life, foretold, events }));
    if (tests.length > 0) this.charts.cof.show(meanCof({ tests, events }));
    this.charts.fan.show(fan({ life, pooled, foretold, events }));
  }

  async rest(data) {
    this.data = data;
    this.charts.cof.show(meanCof(data));
    this.parameters();
    this.loopAreas();
    await this.fetchChannels();
    this.stribeck();
    this.loopCurves();
  }

  /** The raw channels of the tests that are drawn; a run never changes, so each is read once. */
  async fetchChannels() {
    const { tests, loops } = this.data;
    const dynamic = [...new Map(loops.map((loop) => [loop.run_id, loop])).values()];
    const wanted = [...spread(tests, 9), ...spread(tests), ...spread(dynamic), tests.find((test) => test.run_id === this.chosen.run), dynamic.find((each) => each.run_id === this.chosen.loopRun)];
    await Promise.all(wanted.filter((each) => each && !this.channels[each.run_id]).map(({ run_id: id }) => this.fetchRun(id)));
  }

  async fetchRun(id) {
    this.channels[id] ??= (await read(`${clutchPath(this.clutchId)}/runs/${encodeURIComponent(id)}`)).body.channels;
  }

  pressure() {
    const known = pressuresOf(this.data.tests);
    return known.includes(this.chosen.pressure) ? this.chosen.pressure : known.reduce((best, each) => (Math.abs(each - 5) < Math.abs(best - 5) ? each : best), known[0]);
  }

  pressureChoice(redraw) {
    return choice("Pressure", pressuresOf(this.data.tests).map((each) => [each, `${fixed(each, 1)} bar`]), this.pressure(), (value) => { this.chosen.pressure = Number(value); redraw(); });
  }

  stribeck() {
    const { tests, clutch } = this.data;
    const shared = { tests, clutch, channels: this.channels, pressure: this.pressure() };
    const again = () => { this.stribeck(); this.parameters(); };
    const run = tests.some((test) => test.run_id === this.chosen.run) ? this.chosen.run : tests[0]?.run_id;
    set(this.charts.flat, tests.length > 0 && [this.pressureChoice(again)]);
    this.charts.flat.show(flat(shared));
    const over = choice("Torque over speed and", [["pressure", "pressure"], ["cycles", "cycles"]], this.chosen.over, (value) => { this.chosen.over = value; this.stribeck(); });
    const state = choice("State", tests.map((test) => [test.run_id, `${fixed(test.cycles)} cycles`]), run, async (value) => { this.chosen.run = value; await this.fetchRun(value); this.stribeck(); });
    set(this.charts.surface, tests.length > 0 && [over, this.chosen.over === "pressure" ? state : this.pressureChoice(again)]);
    this.charts.surface.show(surface({ ...shared, over: this.chosen.over, run }));
  }

  parameters() {
    const { items, events, tests } = this.data;
    const again = () => { this.parameters(); this.stribeck(); };
    for (const key of Object.keys(PARAMETERS)) {
      set(this.charts[key], tests.length > 0 && [this.pressureChoice(again)]);
      this.charts[key].show(parameter({ items, events, name: key, pressure: this.pressure() }));
    }
    const which = choice("Parameter", Object.entries(PARAMETERS).map(([key, { title }]) => [key, title]), this.chosen.parameter, (value) => { this.chosen.parameter = value; this.parameters(); });
    set(this.charts.landscape, [which]);
    this.charts.landscape.show(landscape({ items, name: this.chosen.parameter }));
  }

  loopAreas() {
    this.charts.areas.show(loopAreas(this.data));
  }

  loopCurves() {
    const { loops } = this.data;
    const levels = loopPressures(loops);
    const runs = [...new Map(loops.map((loop) => [loop.run_id, loop.cycles]))];
    const pressure = levels.includes(this.chosen.loopPressure) ? this.chosen.loopPressure : levels[Math.floor(levels.length / 2)];
    const run = runs.some(([id]) => id === this.chosen.loopRun) ? this.chosen.loopRun : runs[0]?.[0];
    const over = choice("Colour by", [["state", "state"], ["pressure", "pressure"]], this.chosen.loopsOver, (value) => { this.chosen.loopsOver = value; this.loopCurves(); });
    const which = this.chosen.loopsOver === "state"
      ? choice("Pressure", levels.map((each) => [each, `${fixed(each, 1)} bar`]), pressure, (value) => { this.chosen.loopPressure = Number(value); this.loopCurves(); })
      : choice("State", runs.map(([id, at]) => [id, `${fixed(at)} cycles`]), run, async (value) => { this.chosen.loopRun = value; await this.fetchRun(value); this.loopCurves(); });
    set(this.charts.loops, loops.length > 0 && [over, which]);
    this.charts.loops.show(loopCurves({ loops, channels: this.channels, over: this.chosen.loopsOver, pressure, run }));
  }
}

/** Replace a chart's controls, keeping the focus on the one that was used. */
function set(chart, controls) {
  const focused = [...chart.controls.querySelectorAll("select")].indexOf(document.activeElement);
  chart.controls.replaceChildren(...(controls || []));
  if (focused >= 0) chart.controls.querySelectorAll("select")[focused]?.focus();
}
