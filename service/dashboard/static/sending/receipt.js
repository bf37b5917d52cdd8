// What the service made of a run: the curve, the fits, the warnings.

import { curveOf, measuredOf } from "../charts/stribeck_law.js";
import { clutchPath, read, readDrawn } from "../shared/api.js";
import { h, scrolling, svg, symbol, table } from "../shared/dom.js";
import { cycles, fixed, kindName, sentence, significant, withSd, words } from "../shared/format.js";

/** @import { CurvePoint } from "../charts/stribeck_law.js" */

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
  const link = h("a", { href: `/clutches/${encodeURIComponent(clutchId)}${section}`, onclick: close }, change);
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

/** Highest speed of the fitted curves, rpm; they are cut at the highest measured one. */
const MOST_SPEED = 2000;

/**
 * The measured points and the fitted curves, drawn light: the dialog needs no plotting library.
 * @param {Receipt} receipt
 */
async function drawing(receipt) {
  const { clutch_id: clutchId, run_id: runId } = receipt;
  /** @type {[{ body: RunOut }, { body: ClutchOut }]} */
  const [run, clutch] = await Promise.all([readDrawn(clutchId, runId), read(clutchPath(clutchId))]);
  const curves = receipt.fits.map((fit) => ({
    measured: measuredOf(run.body.channels, fit.pressure_bar),
    fitted: curveOf(fit, clutch.body, 0, MOST_SPEED),
  }));
  const all = curves.flatMap(({ measured }) => measured);
  if (all.length === 0) return null;
  const wide = Math.max(...all.map(({ speed }) => speed));
  const high = 1.05 * Math.max(...all.map(({ torque }) => torque));
  /** @param {number} speed */
  const x = (speed) => (46 + (640 * speed) / wide).toFixed(1);
  /** @param {number} torque */
  const y = (torque) => (250 - (235 * torque) / high).toFixed(1);
  /** @param {CurvePoint[]} points */
  const pathOf = (points) =>
    points
      .filter(({ speed }) => speed <= wide)
      .map(({ speed, torque }, index) => `${index ? "L" : "M"}${x(speed)} ${y(torque)}`)
      .join("");
  const label = `Torque over speed: ${all.length} measured points and ${curves.length} fitted curves; the numbers are in the table below`;
  return svg(
    "svg.curve",
    { viewBox: "0 0 700 290", role: "img", "aria-label": label },
    [0, 0.25, 0.5, 0.75, 1].map((share) =>
      svg(
        "g",
        svg("line.grid", { x1: 46, x2: 686, y1: y(share * high), y2: y(share * high) }),
        svg("text", { x: 40, y: Number(y(share * high)) + 4, "text-anchor": "end" }, significant(share * high, 2)),
        svg("text", { x: x(share * wide), y: 267, "text-anchor": "middle" }, fixed(share * wide)),
      ),
    ),
    svg("text", { x: 366, y: 286, "text-anchor": "middle" }, "speed, rpm"),
    svg("text", { x: 46, y: 11 }, "torque, Nm"),
    curves.map(({ measured, fitted }) =>
      svg(
        "g",
        measured.map(({ speed, torque }) => svg("circle", { cx: x(speed), cy: y(torque), r: 2 })),
        svg("path", { d: pathOf(fitted) }),
      ),
    ),
  );
}
