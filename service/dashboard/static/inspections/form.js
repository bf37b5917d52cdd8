// The form that sends an inspection: its measurements first, then each photograph. What is sent again is known already, so
// that a form whose photographs were refused in part is mended and sent once more.

import { send } from "../shared/api.js";
import { field, form, h, numberInput, symbol } from "../shared/dom.js";
import { fixed } from "../shared/format.js";
import { attempted, problemView } from "../shared/problem_view.js";

const TYPES = ["image/png", "image/jpeg", "image/webp"];
/** The note of an inspection that has nothing but photographs. */
const PHOTOGRAPHS_ONLY = "photographs";
const LONGEST_NAME = 200;
const LONGEST_NOTE = 4000;

/** @type {(name: string, attributes: Record<string, string | number | boolean>) => HTMLInputElement} */
const input = (name, attributes) => h("input", { id: `inspection-${name}`, name, ...attributes });

/** @type {(name: string, attributes?: Record<string, string | number | boolean>) => HTMLInputElement} */
const number = (name, attributes) => numberInput({ id: `inspection-${name}`, name, ...attributes });

/** @param {HTMLInputElement} element */
const numberIn = ({ value }) => (value === "" ? null : Number(value));

/** @type {(inspection: InspectionOut) => HTMLElement} what became of an inspection that was sent */
function outcomeOf({ cycles, state }) {
  const [kind, outcome] =
    state === "accepted"
      ? ["good", "is stored."]
      : ["odd", "was stored earlier and then withdrawn. It stays withdrawn until you restore it in the table."];
  return h("p", { class: `notice ${kind}`, role: "status" }, `The inspection at ${fixed(cycles)} cycles ${outcome}`);
}

/** @type {(path: `${ClutchPath}/inspections`, sent: () => Promise<unknown>) => HTMLElement} of the inspections; `sent` hears of stored ones */
export function inspectionForm(path, sent) {
  const cycles = number("cycles", { min: 0, required: true });
  const moment = input("performed-at", { type: "datetime-local" });
  const lining = input("lining", { maxlength: LONGEST_NAME });
  const roughness = number("roughness", { min: 0 });
  const skewness = number("skewness");
  const note = input("note", { maxlength: LONGEST_NOTE });
  const photographs = input("photographs", { type: "file", multiple: true, accept: TYPES.join(",") });
  const answer = h("div.answer", { "aria-live": "polite" });
  const go = h("button.main", "Send the inspection");

  const inspection = () => {
    const [height, skew] = [numberIn(roughness), numberIn(skewness)];
    const pictured = height === null && skew === null && (photographs.files?.length ?? 0) > 0;
    return {
      cycles: numberIn(cycles),
      performed_at: moment.value === "" ? null : new Date(moment.value).toISOString(),
      lining: lining.value,
      roughness_um: height,
      skewness: skew,
      note: note.value || (pictured ? PHOTOGRAPHS_ONLY : ""),
    };
  };

  const store = async () => {
    const { body } = await send("POST", path, inspection());
    const refused = [];
    for (const file of photographs.files ?? []) {
      const type = { "Content-Type": file.type || "application/octet-stream" };
      try {
        await send("POST", `${path}/${body.inspection_id}/photographs`, file, type);
      } catch (problem) {
        refused.push(problemView(problem, `${file.name} is not stored. `));
      }
    }
    if (refused.length === 0) typed.reset();
    answer.replaceChildren(outcomeOf(body), ...refused);
    await sent();
  };

  const fields = h(
    "div.fields",
    field(cycles, "Duty cycles since new"),
    field(moment, "Inspected at"),
    field(lining, "Disc, side or place"),
    field(roughness, ["Roughness ", symbol("R", "a"), ", µm"]),
    field(skewness, ["Skewness ", symbol("R", "sk")]),
    field(note, "Note"),
    field(photographs, "Photographs: PNG, JPEG or WebP"),
  );
  const submit = () => attempted([go], answer, "Sending …", store);
  const typed = form(submit, fields, answer, h("div.row.buttons", go));
  return h("details.inspect", h("summary", "Add an inspection"), typed);
}
