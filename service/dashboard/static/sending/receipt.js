// What the service made of a run: the curve, the fits, the warnings.

import { drawnAlone } from "../charts/draw.js";
import { curvesOfRun } from "../charts/stribeck.js";
import { clutchPath, pageOf, read, readDrawn } from "../shared/api.js";
import { h, scrolling, symbol, table } from "../shared/dom.js";
import { cycles, fixed, kindName, sentence, significant, withSd, words } from "../shared/format.js";

/** What is said of a run that does not count, by its state: that, and where on the clutch's page it is made to count. */
const UNCOUNTED = {
  held: ["It does not count yet. ", "#/overview", "Confirm, correct or withdraw it"],
  withdrawn: ["It was withdrawn later and stays withdrawn. ", "#/runs", "Restore it in the list of runs"],
};

/** @type {(receipt: Receipt) => HTMLElement} what became of a run, in a line */
export function outcomeOf(receipt) {
  const { clutch_id: clutchId, cycles: at, duplicate, kind, run_id: runId, state } = receipt;
  const held = state === "held";
  const result = duplicate ? "Stored before; nothing has changed" : held ? "Stored and held" : "Stored";
  const run = ` · ${kindName(kind)} at ${cycles(at, 0, 20)} cycles · `;
  const name = h("p", h("b", result), run, h("code", runId));
  if (state === "accepted") return h("div.notice.good", name);
  const close = (/** @type {Event} */ event) => {
    if (event.target instanceof Element) event.target.closest("dialog")?.close();
  };
  const [words, section, change] = UNCOUNTED[state];
  const link = h("a", { href: pageOf(clutchId) + section, onclick: close }, change);
  return h("div.notice.odd", name, held && doubtList(receipt), h("p", words, link));
}

/** @type {(receipt: Receipt) => HTMLElement} why a run is held, or was */
export function doubtList({ doubts }) {
  const items = doubts.map(({ message }) => h("li", sentence(message)));
  return h("ul.doubts", items);
}

/** @type {(receipt: Receipt) => Promise<HTMLElement>} a receipt with the curve that was fitted */
export async function receiptView(receipt) {
  const fitted = receipt.fits.length > 0;
  return h(
    "div.receipt",
    warnings(receipt.warnings),
    fitted && (await drawing(receipt)),
    fitted && fitTable(receipt.fits),
    receipt.loops.length > 0 && loopTable(receipt.loops),
  );
}

/** @param {Warned[]} warned */
export function warnings(warned) {
  if (warned.length === 0) return null;
  const items = warned.map(({ code, message }) => h("li", h("b", words(code)), " ", message));
  return h("ul.warnings", items);
}

const FIT_COLUMNS = () => [
  "Pressure, bar",
  "Mean COF",
  [symbol("M", "s"), ", Nm"],
  symbol("M̄", "c"),
  [symbol("V", "S"), ", m/s"],
  [symbol("C", "v"), ", Nm/(m/s)", h("sup", "0.3")],
  "RMSE, Nm",
  "MSE, %",
  "Fit",
];

/** @param {Fit[]} fits */
export function fitTable(fits) {
  const rows = fits.map((fit) => {
    /** @param {keyof StribeckParameters} name */
    const value = (name) =>
      fit.undetermined.includes(name) ? "not determined" : withSd(fit.parameters[name], fit.standard_errors[name]);
    return [
      fixed(fit.pressure_bar, 1),
      withSd(fit.mean_cof, fit.mean_cof_sd),
      value("static_torque_nm"),
      value("coulomb_ratio"),
      value("stribeck_velocity_m_s"),
      value("viscous_coefficient"),
      significant(fit.rmse_nm, 2),
      significant(fit.mse_percent, 2),
      fit.acceptable ? "acceptable" : words(fit.status),
    ];
  });
  return scrolling("Fits", table("Fits by pressure", FIT_COLUMNS(), rows));
}

const LOOP_COLUMNS = [
  "Pressure, bar",
  "Frequency, Hz",
  "Loop area, Nm·m/s",
  "Attractor, Nm/s",
  "Film time, s",
  "Periods",
  "Note",
];

/** @param {Loop[]} loops */
export function loopTable(loops) {
  const rows = loops.map((loop) => [
    fixed(loop.pressure_bar, 1),
    significant(loop.frequency_hz, 3),
    withSd(loop.loop_area_nm_m_s, loop.loop_area_sd_nm_m_s),
    withSd(loop.attractor_nm_s, loop.attractor_sd_nm_s),
    withSd(loop.film_time_s, loop.film_time_sd_s),
    String(loop.periods),
    loop.message || words(loop.status),
  ]);
  return scrolling("Loops", table("Loops by pressure", LOOP_COLUMNS, rows));
}

/** @type {(receipt: Receipt) => Promise<SVGSVGElement | null>} the measured points and the fitted curves */
async function drawing(receipt) {
  const { clutch_id: clutchId, run_id: runId, fits } = receipt;
  const [run, clutch] = await Promise.all([readDrawn(clutchId, runId), read(clutchPath(clutchId))]);
  const { figure, rows = [] } = curvesOfRun(receipt, run.body.channels, clutch.body);
  const points = rows.filter(([kind]) => kind === "measured").length;
  const text = `Torque over speed: ${points} measured points and ${fits.length} fitted curves; the numbers are in the table below`;
  return figure && points > 0 ? drawnAlone(figure, { width: 760, height: 300 }, text) : null;
}
