// What the service made of a run: the curve, the fits, the warnings; or what is wrong with it, place by place.

import { clutchPath, read } from "./api.js";
import { h, svg, symbol, table } from "./dom.js";
import { cycles, fixed, kindName, significant, withSd, words } from "./format.js";
import { curveOf, measuredOf } from "./stribeck.js";

/** A receipt with the curve that was fitted. */
export async function receiptView(receipt) {
  const said = receipt.duplicate ? "Known already: nothing was stored twice" : "Stored";
  return h("div", { class: "receipt" },
    h("p", { class: "notice good" }, h("b", {}, said), ` · ${kindName(receipt.kind)} at ${cycles(receipt.cycles, 0, 20)} cycles · `, h("code", {}, receipt.run_id)),
    warnings(receipt.warnings),
    receipt.fits.length > 0 ? await drawing(receipt) : null,
    receipt.fits.length > 0 ? fitTable(receipt.fits) : null,
    receipt.loops.length > 0 ? loopTable(receipt.loops) : null);
}

export function warnings(found) {
  if (found.length === 0) return null;
  return h("ul", { class: "warnings" }, found.map(({ code, message }) => h("li", {}, h("b", {}, words(code)), " ", message)));
}

export function fitTable(fits) {
  const columns = ["Pressure, bar", "Mean COF", [symbol("M", "s"), ", Nm"], symbol("M̄", "c"), [symbol("V", "S"), ", m/s"], [symbol("C", "v"), ", Nm/(m/s)", h("sup", {}, "0.3")], "RMSE, Nm", "MSE, %", "Fit"];
  const rows = fits.map((fit) => {
    const value = (name) => (fit.undetermined.includes(name) ? "not determined" : withSd(fit.parameters[name], fit.standard_errors[name]));
    return [fixed(fit.pressure_bar, 1), withSd(fit.mean_cof, fit.mean_cof_sd), value("static_torque_nm"), value("coulomb_ratio"), value("stribeck_velocity_m_s"),
      value("viscous_coefficient"), significant(fit.rmse_nm, 2), significant(fit.mse_percent, 2), fit.acceptable ? "acceptable" : words(fit.status)];
  });
  return h("div", { class: "scroll", tabindex: "0", role: "group", "aria-label": "Fits" }, table("Fits by pressure", columns, rows));
}

export function loopTable(loops) {
  const columns = ["Pressure, bar", "Frequency, Hz", "Loop area, Nm·m/s", "Attractor, Nm·s", "Periods", "Note"];
  const rows = loops.map((loop) => [fixed(loop.pressure_bar, 1), significant(loop.frequency_hz, 3), withSd(loop.loop_area_nm_m_s, loop.loop_area_sd_nm_m_s),
    withSd(loop.attractor_nm_s, loop.attractor_sd_nm_s), String(loop.periods), loop.message || words(loop.status)]);
  return h("div", { class: "scroll", tabindex: "0", role: "group", "aria-label": "Loops" }, table("Loops by pressure", columns, rows));
}

/** The measured points and the fitted curves, drawn light: the dialog needs no plotting library. */
async function drawing(receipt) {
  const [run, clutch] = await Promise.all([read(`${clutchPath(receipt.clutch_id)}/runs/${encodeURIComponent(receipt.run_id)}`), read(clutchPath(receipt.clutch_id))]);
  const curves = receipt.fits.map((fit) => ({ measured: measuredOf(run.body.channels, fit.pressure_bar), fitted: curveOf(fit, clutch.body, 0, 2000) }));
  const all = curves.flatMap(({ measured }) => measured);
  if (all.length === 0) return null;
  const [wide, high] = [Math.max(...all.map((point) => point.speed)), Math.max(...all.map((point) => point.torque)) * 1.05];
  const x = (speed) => (46 + (640 * speed) / wide).toFixed(1);
  const y = (torque) => (250 - (235 * torque) / high).toFixed(1);
  const ticks = [0, 0.25, 0.5, 0.75, 1];
  const path = (points) => points.filter((point) => point.speed <= wide).map((point, index) => `${index ? "L" : "M"}${x(point.speed)} ${y(point.torque)}`).join("");
  return svg("svg", { class: "curve", viewBox: "0 0 700 290", role: "img", "aria-label": `Torque over speed: ${all.length} measured points and ${curves.length} fitted curves; the numbers are in the table below` },
    ticks.map((share) => svg("g", {}, svg("line", { class: "grid", x1: 46, x2: 686, y1: y(share * high), y2: y(share * high) }),
      svg("text", { x: 40, y: Number(y(share * high)) + 4, "text-anchor": "end" }, significant(share * high, 2)),
      svg("text", { x: x(share * wide), y: 267, "text-anchor": "middle" }, fixed(share * wide)))),
    svg("text", { x: 366, y: 286, "text-anchor": "middle" }, "speed, rpm"), svg("text", { x: 46, y: 11 }, "torque, Nm"),
    curves.map(({ measured, fitted }) => svg("g", {}, measured.map((point) => svg("circle", { cx: x(point.speed), cy: y(point.torque), r: 2 })), svg("path", { d: path(fitted) }))));
}

/** A problem, with every place that is wrong in it. */
export function wrongView(problem, lead = problem.status > 0 ? "Not stored. " : "Not sent. ") {
  if (problem.status === undefined) throw problem;
  const rows = problem.errors.map((each) => [each.row === null ? "" : String(each.row), each.pointer, each.value, each.message]);
  const more = problem.total > rows.length ? `${rows.length} of ${problem.total} errors are shown.` : null;
  return h("div", {},
    h("p", { class: "notice bad", role: "alert" }, h("b", {}, lead), problem.title ? `${problem.title}: ` : "", problem.detail ?? ""),
    rows.length > 0 ? h("div", { class: "scroll", tabindex: "0", role: "group", "aria-label": "What is wrong" }, table("What is wrong, by place", ["Row", "Place", "Value", "What is wrong"], rows)) : null,
    more ? h("p", { class: "quiet" }, more) : null);
}
