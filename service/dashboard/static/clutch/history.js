// @ts-check
// The tab of what has been: remaining life as it was predicted at each test, inspections, and who changed what.

import { Chart } from "../charts/chart.js";
import { remainingCycles } from "../charts/life.js";
import { Inspections } from "../inspections/inspections.js";
import { within } from "../shared/dom.js";
import { AuditTrail } from "./audit.js";
import { askInspection } from "./changes.js";

/** @import { Page } from "./clutch.js" */

export class History {
  /**
   * @param {HTMLElement} _place
   * @param {Page} page
   */
  constructor(_place, { reader, done }) {
    this.reader = reader;
    const { name } = reader;
    this.predicted = new Chart({ name, id: "predicted", title: "Remaining cycles, as predicted", wide: true });
    within("predictions", ".charts").append(this.predicted.element);
    this.inspections = new Inspections(within("inspections", ".body"), reader.id, name, (inspection) =>
      done(askInspection(inspection)),
    );
    this.audit = new AuditTrail(within("changes", ".body"), reader.id);
  }

  async show() {
    const { runs: counted } = this.reader.present();
    this.predicted.element.hidden = counted === 0;
    await Promise.all([this.poll(), this.showChanges(), counted > 0 && this.showPredictions()]);
  }

  async showChanges() {
    await this.audit.show(await this.reader.runs());
  }

  async showPredictions() {
    this.predicted.show(remainingCycles(await this.reader.forecast()));
  }

  /** Inspections come without a change of the clutch. */
  async poll() {
    await this.inspections.poll(await this.reader.events());
  }
}
