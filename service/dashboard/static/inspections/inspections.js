// The section of the inspections: their list goes in; R_a and R_sk over cycles, a table, photographs by state and a form come
// out. Open this file first, then photographs.js (thumbnails, and one opened larger) and form.js (an inspection sent with its
// photographs).

import { Chart } from "../charts/chart.js";
import { CYCLES, digitsColumn, distinct } from "../charts/columns.js";
import { rampOf } from "../charts/palette.js";
import { planar } from "../charts/traces.js";
import { readAll } from "../shared/api.js";
import { button, h, quiet, scrolling, symbol, table } from "../shared/dom.js";
import { files } from "../shared/files.js";
import { fixed, moment, significant } from "../shared/format.js";
import { inspectionForm } from "./form.js";
import { gallery } from "./photographs.js";

/** The quantities: the axis' title, and what their course says. */
const QUANTITIES = {
  roughness_um: {
    title: "R<sub>a</sub>, µm",
    name: "R_a, µm",
    meaning: "Arithmetic mean roughness: it falls as the lining is worn smooth.",
  },
  skewness: {
    title: "R<sub>sk</sub>",
    name: "R_sk",
    meaning: "Skewness of the heights: negative where peaks are flattened and valleys remain.",
  },
};

/** @typedef {keyof typeof QUANTITIES} SurfaceQuantity */

/** @type {(lining: string) => string} a lining's name as the charts write it; without one, what it is */
const nameOf = (lining) => lining.replaceAll("<", "‹") || "lining"; // no markup comes from outside

/** @type {(answers: { items: InspectionOut[], events: Receipt[], quantity: SurfaceQuantity }) => Spec} */
function surfaceOverLife({ items, events, quantity }) {
  const { title, name, meaning } = QUANTITIES[quantity];
  const measured = items.filter((item) => item[quantity] !== null);
  if (measured.length === 0) return { empty: `No inspection has measured ${name.split(",")[0]} yet.` };
  const linings = [...new Set(measured.map(({ lining }) => lining))].sort();
  const states = distinct(measured.map(({ cycles }) => cycles)).length;
  return {
    note: `${meaning} Inspected at ${states === 1 ? "one number" : `${fixed(states)} different numbers`} of cycles.`,
    columns: [{ name: "lining" }, CYCLES, digitsColumn(name, 3)],
    rows: measured.map((item) => [item.lining, item.cycles, item[quantity]]),
    figure: planar("duty cycles", title, events, (c) =>
      linings.map((lining, index) => {
        const values = measured.filter((item) => item.lining === lining);
        const color = rampOf(c, index, linings.length);
        return {
          name: nameOf(lining),
          x: values.map(({ cycles }) => cycles),
          y: values.map((item) => item[quantity]),
          line: { color, width: 1.4 },
          marker: { color, size: 7 },
        };
      }),
    ),
  };
}

const ABOUT =
  "Roughness and skewness of the lining's surface profile, and photographs of it. They are kept beside the runs: no prediction uses them.";

/**
 * Reads the list, and draws it where something is another than before, with events as marks in the charts.
 * @param {HTMLElement} place
 * @param {{ id: string, path: ClutchPath }} clutch
 * @param {(inspection: InspectionOut) => unknown} change asks whether to withdraw an inspection, or to restore it
 */
export function inspections(place, { id, path }, change) {
  const base = /** @type {const} */ (`${path}/inspections`);
  const roughness = new Chart({ id: "roughness", title: "Roughness", letter: ["R", "a"], height: 300 });
  const skewness = new Chart({ id: "skewness", title: "Skewness", letter: ["R", "sk"], height: 300 });
  const charts = h("div.charts", { hidden: true }, roughness.element, skewness.element);
  const list = h("div.inspections");
  const photographs = gallery(base);
  place.replaceChildren(
    quiet(ABOUT),
    charts,
    list,
    photographs.element,
    inspectionForm(base, () => poll(marks)),
  );
  /** @type {Receipt[]} */
  let marks = [];
  /** @type {InspectionOut[] | null} those that are accepted; null before they are read */
  let accepted = null;

  async function poll(/** @type {Receipt[]} */ events) {
    const { items, changed } = await readAll(`${base}?limit=1000`);
    const different = changed || accepted === null;
    if (different) {
      items.sort((a, b) => a.cycles - b.cycles || a.lining.localeCompare(b.lining));
      list.replaceChildren(...(items.length > 0 ? listed(items) : [h("p", "No inspection yet.")]));
      accepted = items.filter(({ state }) => state === "accepted");
      photographs.show(accepted);
    }
    if (accepted !== null && (different || events !== marks)) draw(accepted, events);
    marks = events;
  }

  /** @type {(own: InspectionOut[], events: Receipt[]) => void} */
  function draw(own, events) {
    charts.hidden = own.every((item) => item.roughness_um === null && item.skewness === null);
    roughness.show(surfaceOverLife({ items: own, events, quantity: "roughness_um" }));
    skewness.show(surfaceOverLife({ items: own, events, quantity: "skewness" }));
  }

  /** @param {InspectionOut[]} items */
  function listed(items) {
    const measured = [h("span", symbol("R", "a"), ", µm"), symbol("R", "sk")];
    const columns = ["Duty cycles", "Inspected", "Lining", ...measured, "Note", "Photographs", "Change"];
    const all = table("Inspections, by duty cycles", columns, items.map(row));
    return [quiet(files(`${id}-inspections`, `${base}.csv`)), h("div.panel", scrolling("Inspections", all))];
  }

  /** @param {InspectionOut} item */
  function row(item) {
    const withdrawn = item.state === "withdrawn";
    const cycles = fixed(item.cycles);
    const mark = h("span.mark-withdrawn", "withdrawn");
    const label = `${withdrawn ? "Restore" : "Withdraw"} the inspection at ${cycles} cycles`;
    return [
      withdrawn ? [h("s", cycles), " ", mark] : cycles,
      moment(item.performed_at),
      item.lining || "–",
      significant(item.roughness_um),
      significant(item.skewness),
      item.note || "–",
      String(item.photographs.length),
      button(withdrawn ? "Restore …" : "Withdraw …", () => change(item), { class: "small", "aria-label": label }),
    ];
  }

  return poll;
}
