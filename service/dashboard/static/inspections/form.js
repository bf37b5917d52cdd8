// @ts-check
// The form that sends an inspection: its measurements first, then each photograph. What is sent again is known already, so
// that a form whose photographs were refused in part is mended and sent once more.

import { clutchPath, send, sendJson } from "../shared/api.js";
import { field, h, quiet, symbol } from "../shared/dom.js";
import { fixed } from "../shared/format.js";
import { problemView } from "../shared/problem_view.js";

/** @import { InspectionOut } from "../shared/types.js" */

const TYPES = ["image/png", "image/jpeg", "image/webp"];
/** The note of an inspection that has nothing but photographs. */
const PHOTOGRAPHS_ONLY = "photographs";
const LONGEST_NAME = 200;
const LONGEST_NOTE = 4000;

/** @type {(name: string, attributes: Record<string, string | number | boolean>) => HTMLInputElement} */
const input = (name, attributes) => h("input", { id: `inspection-${name}`, name, autocomplete: "off", ...attributes });

/** @param {HTMLInputElement} element */
const numberIn = ({ value }) => (value === "" ? null : Number(value));

/** @type {(inspection: InspectionOut) => HTMLElement} what became of an inspection that was sent */
function outcomeOf({ cycles, state }) {
  const named = `The inspection at ${fixed(cycles)} cycles`;
  return state === "accepted"
    ? h("p", { class: "notice good", role: "status" }, `${named} is stored.`)
    : h(
        "p",
        { class: "notice odd", role: "status" },
        `${named} was stored earlier and then withdrawn. It stays withdrawn until you restore it in the table.`,
      );
}

export class InspectionForm {
  /**
   * @param {string} clutchId
   * @param {() => Promise<unknown>} sent called when something was stored
   */
  constructor(clutchId, sent) {
    this.base = `${clutchPath(clutchId)}/inspections`;
    this.sent = sent;
    const numeric = { type: "number", step: "any", inputmode: "decimal" };
    this.cycles = input("cycles", { ...numeric, min: 0, required: true });
    this.moment = input("performed-at", { type: "datetime-local" });
    this.lining = input("lining", { maxlength: LONGEST_NAME });
    this.roughness = input("roughness", { ...numeric, min: 0 });
    this.skewness = input("skewness", numeric);
    this.note = input("note", { maxlength: LONGEST_NOTE });
    this.files = input("photographs", { type: "file", multiple: true, accept: TYPES.join(",") });
    this.answer = h("div", { class: "answer", "aria-live": "polite" });
    this.go = h("button", { class: "main" }, "Send the inspection");
    const fields = h(
      "div",
      { class: "fields" },
      field(this.cycles, "Duty cycles since new"),
      field(this.moment, "Inspected at"),
      field(this.lining, "Disc, side or place"),
      field(this.roughness, ["Roughness ", symbol("R", "a"), ", µm"]),
      field(this.skewness, ["Skewness ", symbol("R", "sk")]),
      field(this.note, "Note"),
      field(this.files, "Photographs: PNG, JPEG or WebP"),
    );
    const buttons = h("div", { class: "buttons" }, this.go);
    this.form = h("form", { onsubmit: this.submit }, fields, this.answer, buttons);
    this.element = h("details", { class: "inspect" }, h("summary", {}, "Add an inspection"), this.form);
  }

  submit = async (/** @type {SubmitEvent} */ event) => {
    event.preventDefault();
    this.go.disabled = true;
    this.answer.replaceChildren(quiet("Sending …"));
    try {
      /** @type {{ body: InspectionOut }} */
      const { body } = await sendJson("POST", this.base, this.inspection());
      const refused = await this.sendPhotographs(`${this.base}/${body.inspection_id}/photographs`);
      if (refused.length === 0) this.form.reset();
      this.answer.replaceChildren(outcomeOf(body), ...refused);
      await this.sent();
    } catch (problem) {
      this.answer.replaceChildren(problemView(problem));
    } finally {
      this.go.disabled = false;
    }
  };

  inspection() {
    const [roughness, skewness] = [numberIn(this.roughness), numberIn(this.skewness)];
    const pictured = roughness === null && skewness === null && (this.files.files?.length ?? 0) > 0;
    return {
      cycles: numberIn(this.cycles),
      performed_at: this.moment.value === "" ? null : new Date(this.moment.value).toISOString(),
      lining: this.lining.value,
      roughness_um: roughness,
      skewness,
      note: this.note.value || (pictured ? PHOTOGRAPHS_ONLY : ""),
    };
  }

  /**
   * Send every photograph; what is said of those that were refused.
   * @param {string} address
   */
  async sendPhotographs(address) {
    const refused = [];
    for (const file of this.files.files ?? []) {
      try {
        await send("POST", address, file, { "Content-Type": file.type || "application/octet-stream" });
      } catch (problem) {
        refused.push(problemView(problem, `${file.name} is not stored. `));
      }
    }
    return refused;
  }
}
