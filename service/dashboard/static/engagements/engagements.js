// The section of the measured engagements: their answer of the API goes in, two charts and the choices above them come out:
// an indicator over the life, and one engagement beside what the tracked model gives for the same pressure and drive.

import { Chart, chartsOf, chooser, setControls } from "../charts/chart.js";
import { column, CYCLES, digitsColumn, HALF_OF_90, KIND } from "../charts/columns.js";
import { measuredLine, planar } from "../charts/traces.js";
import { INDICATORS, optionsOf, stateOptions, titleOf } from "../quantities/names.js";
import { readIfThere } from "../shared/api.js";
import { offered, section } from "../shared/dom.js";
import { fixed, percent, quantity, significant } from "../shared/format.js";

const CHANNELS = /** @type {const} */ (["torque_nm", "speed_rpm", "pressure_bar"]);

/** @typedef {keyof typeof INDICATORS} Indicator */
/** @typedef {(typeof CHANNELS)[number]} Channel */

const NO_ENGAGEMENT =
  "No measured engagement yet. Send one with a block of duty: time_s, pressure_bar, speed_rpm and torque_nm of one engagement.";
const NO_VALUE = "None of the engagements determines this indicator.";
const NO_COMPARISON = "To simulate an engagement, the present life needs a stationary test and a measured engagement.";

/** @type {(answers: { measured: MeasuredEngagement[], events: Receipt[], name: Indicator }) => Spec} */
function indicatorOverLife({ measured, events, name }) {
  if (measured.length === 0) return { empty: NO_ENGAGEMENT };
  const values = measured.flatMap(({ cycles, indicators: { [name]: estimate } }) =>
    estimate === null ? [] : [{ x: cycles, value: estimate.value, sd: estimate.sd }],
  );
  if (values.length === 0) return { empty: NO_VALUE };
  const title = titleOf(INDICATORS[name]);
  return {
    note: `From ${fixed(values.length)} measured engagements. The 90 % error bars come from the noise of the records.`,
    columns: [CYCLES, digitsColumn(title, 4), digitsColumn("standard error", 2)],
    rows: values.map(({ x, value, sd }) => [x, value, sd]),
    figure: planar("duty cycles", title, events, (c) => [measuredLine("", values, { size: 7, color: c.accent })]),
  };
}

/** @type {(answers: { compared: ComparedEngagement | null, name: Channel }) => Spec} beside the model's */
function engagementTrace({ compared, name }) {
  if (compared === null) return { empty: NO_COMPARISON };
  const { channels, model, cycles } = compared;
  const title = quantity(name);
  const kinds = [{ kind: "measured", trace: channels }, ...(model ? [{ kind: "model", trace: model.channels }] : [])];
  return {
    note: `After ${fixed(cycles)} cycles. ${discrepancyOf(compared)}`,
    columns: [KIND, column("time since contact, s", 3), digitsColumn(title, 4)],
    rows: kinds.flatMap(({ kind, trace }) => trace.time_s.map((time, index) => [kind, time, trace[name][index]])),
    figure: planar("time since contact, s", title, [], (c) =>
      kinds.map(({ kind, trace }) => traceOf(kind, trace, name, c)),
    ),
  };
}

/** @type {(kind: string, trace: EngagementTrace, name: Channel, c: Colours) => Curve} */
const traceOf = (kind, trace, name, c) => ({
  name: kind === "measured" ? kind : "tracked model",
  x: trace.time_s,
  y: trace[name],
  line: kind === "measured" ? { color: c.accent, width: 1.6 } : { color: c.worn, width: 1.6, dash: "dash" },
});

/** @type {(compared: ComparedEngagement) => string} where measurement and model part, in a sentence */
function discrepancyOf({ model }) {
  if (model === null)
    return "The record does not show what drove the shaft, so no simulated engagement is drawn beside it.";
  const torque = `Model discrepancy: ${percent(model.torque_discrepancy, 1)} of torque (RMS, while both slip)`;
  const { stop_time_difference_s: difference, stop_time_difference_sd_s: sd } = model;
  if (difference === null) return `${torque}; in the model, the clutch does not stop the shaft.`;
  const half = sd === null ? "" : ` ± ${significant(HALF_OF_90 * sd, 2)}`;
  return `${torque}; stops ${significant(Math.abs(difference), 3)}${half} s ${difference > 0 ? "later" : "earlier"} than the model.`;
}

/** @type {Pick<EngagementOut, "measured" | "compared">} */
const NOTHING = { measured: [], compared: null };

/** @typedef {{ path: ClutchPath } & Record<"runs" | "events", () => Promise<Receipt[]>>} Reader of a clutch */

/** @type {(place: HTMLElement, reader: Reader) => { show: () => Promise<void> }} */
export function engagementsTab(place, reader) {
  const overLife = new Chart({ id: "engagement-indicators", title: "An indicator over cycles", height: 400 });
  const trace = new Chart({ id: "engagement-trace", title: "An engagement against the model", height: 400 });
  place.append(section("engagements", "Engagements", chartsOf(overLife, trace)));
  let answer = NOTHING;
  /** @type {Receipt[]} */
  let events = [];
  /** @type {{ indicator: Indicator, channel: Channel, run?: string }} */
  const chosen = { indicator: "stop_time_s", channel: "torque_nm" };
  const choose = chooser(chosen, async (what) => {
    if (what === "indicator") return drawOverLife();
    if (what === "run") answer = await ask();
    drawTrace();
  });

  /** The answer; without a stationary test there is no model and none. */
  async function ask() {
    const run = chosen.run === undefined ? "" : `run_id=${encodeURIComponent(chosen.run)}`;
    return (await readIfThere(`${reader.path}/engagement?${run}`))?.body ?? NOTHING;
  }

  function drawOverLife() {
    const { measured } = answer;
    setControls(overLife, measured.length > 0 ? [choose("indicator", "Indicator", optionsOf(INDICATORS))] : []);
    overLife.show(indicatorOverLife({ measured, events, name: chosen.indicator }));
  }

  function drawTrace() {
    const { measured, compared } = answer;
    const state = choose("run", "Cycles", stateOptions(measured), compared?.run_id);
    setControls(trace, compared === null ? [] : [choose("channel", "Channel", offered(CHANNELS, quantity)), state]);
    trace.show(engagementTrace({ compared, name: chosen.channel }));
  }

  return {
    show: async () => {
      const runs = await reader.runs();
      events = await reader.events();
      const evaluated = runs.filter((run) => run.engagement?.status === "determined");
      if (!evaluated.some((run) => run.run_id === chosen.run)) chosen.run = undefined;
      answer = evaluated.length > 0 ? await ask() : NOTHING;
      drawOverLife();
      drawTrace();
    },
  };
}
