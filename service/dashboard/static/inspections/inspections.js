// @ts-check
// The section of the inspections: their list goes in; R_a and R_sk over cycles, a table, photographs by state and a form come
// out. Open this file first, then charts.js (what the charts show), photographs.js (thumbnails, and one opened larger) and
// form.js (an inspection sent with its photographs).

import { Chart } from "../charts/chart.js";
import { clutchPath, readAll } from "../shared/api.js";
import { button, h, quiet, scrolling, symbol, table } from "../shared/dom.js";
import { files } from "../shared/files.js";
import { fixed, moment, significant } from "../shared/format.js";
import { surfaceOverLife } from "./charts.js";
import { InspectionForm } from "./form.js";
import { Photographs } from "./photographs.js";

/** @import { InspectionOut, Receipt } from "../shared/types.js" */

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
