// @ts-check
// The section of the inspections: their list goes in; R_a and R_sk over cycles, a table, photographs by state and a form come
// out. Open this file first, then photographs.js (thumbnails, and one opened larger) and form.js (an inspection sent with its
// photographs).

import { Chart } from "../charts/chart.js";
import { CYCLES, digitsColumn, distinct } from "../charts/columns.js";
import { eventMarks } from "../charts/layout.js";
import { rampOf } from "../charts/palette.js";
import { titled } from "../charts/traces.js";
import { clutchPath, readAll } from "../shared/api.js";
import { button, h, quiet, scrolling, symbol, table } from "../shared/dom.js";
import { files } from "../shared/files.js";
import { fixed, moment, significant } from "../shared/format.js";
import { InspectionForm } from "./form.js";
import { Photographs } from "./photographs.js";

/** @import { Spec } from "../charts/types.js" */
/** @import { InspectionOut, Receipt } from "../shared/types.js" */

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

/** @type {(answers: { inspections: InspectionOut[], events: Receipt[], quantity: SurfaceQuantity }) => Spec} */
function surfaceOverLife({ inspections, events, quantity }) {
  const { title, name, meaning } = QUANTITIES[quantity];
  const measured = inspections.filter((item) => item[quantity] !== null);
  if (measured.length === 0) return { empty: `No inspection has measured ${name.split(",")[0]} yet.` };
  const linings = [...new Set(measured.map(({ lining }) => lining))].sort();
  const states = distinct(measured.map(({ cycles }) => cycles)).length;
  return {
    note: `${meaning} Inspected at ${states === 1 ? "one number" : `${fixed(states)} different numbers`} of cycles.`,
    columns: [{ name: "lining" }, CYCLES, digitsColumn(name, 3)],
    rows: measured.map((item) => [item.lining, item.cycles, item[quantity]]),
    figure: (c) => ({
      data: linings.map((lining, index) => {
        const values = measured.filter((item) => item.lining === lining);
        const color = rampOf(c, index, linings.length);
        return {
          name: nameOf(lining),
          showlegend: linings.length > 1,
          mode: "lines+markers",
          x: values.map(({ cycles }) => cycles),
          y: values.map((item) => item[quantity]),
          line: { color, width: 1.4 },
          marker: { color, size: 7 },
          hovertemplate: `%{x:,.0f} cycles<br>${name} %{y:.4g}<extra>%{fullData.name}</extra>`,
        };
      }),
      layout: { xaxis: titled("duty cycles"), yaxis: titled(title), ...eventMarks(events, c) },
    }),
  };
}

const ABOUT =
  "Roughness and skewness of the lining's surface profile, and photographs of it. They are kept beside the runs: no prediction uses them.";

export class Inspections {
  /**
   * @param {HTMLElement} place
   * @param {string} clutchId
   * @param {() => string} name the start of saved files' names
   * @param {(inspection: InspectionOut) => unknown} change asks whether to withdraw an inspection, or to restore it
   */
  constructor(place, clutchId, name, change) {
    this.clutchId = clutchId;
    this.change = change;
    this.roughness = new Chart({ name, id: "roughness", title: "Roughness", letter: ["R", "a"], height: 300 });
    this.skewness = new Chart({ name, id: "skewness", title: "Skewness", letter: ["R", "sk"], height: 300 });
    this.charts = h("div", { class: "charts", hidden: true }, this.roughness.element, this.skewness.element);
    this.list = h("div", { class: "inspections" });
    this.photographs = new Photographs(clutchId);
    const form = new InspectionForm(clutchId, () => this.poll(this.events));
    place.replaceChildren(quiet(ABOUT), this.charts, this.list, this.photographs.element);
    place.append(form.element);
    /** @type {Receipt[]} */
    this.events = [];
    /** @type {InspectionOut[] | null} those that are accepted; null before they are read */
    this.accepted = null;
  }

  /**
   * Read the list, and draw it where something is another than before.
   * @param {Receipt[]} events marks in the charts
   */
  async poll(events) {
    /** @type {{ items: InspectionOut[], changed: boolean }} */
    const { items, changed } = await readAll(`${clutchPath(this.clutchId)}/inspections?limit=1000`);
    if (changed || this.accepted === null) {
      items.sort((a, b) => a.cycles - b.cycles || a.lining.localeCompare(b.lining));
      this.list.replaceChildren(...(items.length > 0 ? this.table(items) : [h("p", {}, "No inspection yet.")]));
      const accepted = items.filter(({ state }) => state === "accepted");
      this.photographs.show(accepted);
      this.draw(accepted, events);
    } else if (events !== this.events) {
      this.draw(this.accepted, events);
    }
  }

  /** @type {(accepted: InspectionOut[], events: Receipt[]) => void} */
  draw(accepted, events) {
    this.accepted = accepted;
    this.events = events;
    this.charts.hidden = accepted.every((item) => item.roughness_um === null && item.skewness === null);
    this.roughness.show(surfaceOverLife({ inspections: accepted, events, quantity: "roughness_um" }));
    this.skewness.show(surfaceOverLife({ inspections: accepted, events, quantity: "skewness" }));
  }

  /** @param {InspectionOut[]} items */
  table(items) {
    const rows = items.map((item) => this.row(item));
    const roughness = h("span", {}, symbol("R", "a"), ", µm");
    const measured = [roughness, symbol("R", "sk")];
    const columns = ["Duty cycles", "Inspected", "Lining", ...measured, "Note", "Photographs", "Change"];
    return [
      quiet(files(`${this.clutchId}-inspections`, `${clutchPath(this.clutchId)}/inspections.csv`)),
      h("div", { class: "panel" }, scrolling("Inspections", table("Inspections, by duty cycles", columns, rows))),
    ];
  }

  /** @param {InspectionOut} item */
  row(item) {
    const withdrawn = item.state === "withdrawn";
    const cycles = fixed(item.cycles);
    const mark = h("span", { class: "mark-withdrawn" }, "withdrawn");
    const label = `${withdrawn ? "Restore" : "Withdraw"} the inspection at ${cycles} cycles`;
    const onclick = () => this.change(item);
    return [
      withdrawn ? [h("s", {}, cycles), " ", mark] : cycles,
      item.performed_at === null ? "–" : moment(item.performed_at),
      item.lining || "–",
      significant(item.roughness_um),
      significant(item.skewness),
      item.note || "–",
      String(item.photographs.length),
      button(withdrawn ? "Restore …" : "Withdraw …", onclick, { class: "small", "aria-label": label }),
    ];
  }
}
