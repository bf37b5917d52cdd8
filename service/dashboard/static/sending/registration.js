// @ts-check
// A clutch is registered by a form that is submitted, never by a name that was typed: all its values are shown first.

import { sendJson } from "../shared/api.js";
import { answered, button, field, h, quiet } from "../shared/dom.js";
import { problemView } from "../shared/problem_view.js";

/** @import { ClutchIn } from "../shared/types.js" */

/** @typedef {{ [Key in keyof ClutchIn]?: Partial<ClutchIn[Key]> }} ClutchRecord a clutch as the API takes it */

/** The form's values at first: the reference's clutch, as the service fills in what is left out. */
export const DEFAULTS = {
  geometry: {
    inner_diameter_mm: 99,
    outer_diameter_mm: 133,
    friction_faces: 2,
    mean_radius_mm: null,
    pressure_factor: 1,
  },
  oil: { kinematic_viscosity_40c_cst: 56, kinematic_viscosity_100c_cst: 9.3 },
  end_of_life: { cof_fraction: 0.5 },
  friction_material: "paper",
  reaction_plate: "steel",
  fluid: "ATF",
};

export const IDENTIFIER = {
  pattern: "[A-Za-z0-9][A-Za-z0-9._:@+\\-]{0,127}",
  title: "letters, digits and . _ : @ + -",
};

/** @typedef {{ group: string | null, name: string, label: string, integer?: boolean, text?: boolean, optional?: string }} Field */

/** @type {[string, Field[]][]} */
const SECTIONS = [
  [
    "Geometry",
    [
      { group: "geometry", name: "inner_diameter_mm", label: "Inner diameter, mm" },
      { group: "geometry", name: "outer_diameter_mm", label: "Outer diameter, mm" },
      { group: "geometry", name: "friction_faces", label: "Friction faces", integer: true },
      { group: "geometry", name: "mean_radius_mm", label: "Mean radius, mm", optional: "from the diameters" },
      { group: "geometry", name: "pressure_factor", label: "Lining pressure divided by line pressure" },
    ],
  ],
  [
    "Oil",
    [
      { group: "oil", name: "kinematic_viscosity_40c_cst", label: "Viscosity at 40 °C, cSt" },
      { group: "oil", name: "kinematic_viscosity_100c_cst", label: "Viscosity at 100 °C, cSt" },
      { group: null, name: "fluid", label: "Fluid", text: true },
    ],
  ],
  [
    "Materials",
    [
      { group: null, name: "friction_material", label: "Friction material", text: true },
      { group: null, name: "reaction_plate", label: "Reaction plate", text: true },
    ],
  ],
  [
    "End of life",
    [{ group: "end_of_life", name: "cof_fraction", label: "Mean COF as a share of its value when new, 0 to 1" }],
  ],
];

/**
 * The form in a dialog; resolves to the clutch to go on with: the one that was registered, one of `similar`, or null where
 * the reader leaves it.
 * @param {string} id
 * @param {{ similar?: string[], record?: ClutchRecord | null, lead?: string }} [options] registered names, one of which may be
 *   meant; other values at first; why the form is shown
 * @returns {Promise<string | null>}
 */
export function register(id, { similar = [], record = null, lead = "" } = {}) {
  const dialog = h("dialog", { class: "registration", "aria-labelledby": "registration-title" });
  /** @type {string | null} */
  let result = null;
  /** @param {string} chosen */
  const end = (chosen) => {
    result = chosen;
    dialog.close();
  };
  const others = similar.map((name) => button(`Send to ${name} instead`, () => end(name)));
  dialog.append(
    h("h2", { id: "registration-title" }, "Register a clutch"),
    lead && h("p", { class: "notice" }, lead),
    others.length > 0 ? h("p", { class: "buttons start" }, others) : "",
    quiet("These are the values of the reference clutch. Change the values that differ on your clutch."),
    form(id, record, end, () => dialog.close()),
  );
  return answered(dialog, () => result);
}

/**
 * @param {string} id
 * @param {ClutchRecord | null} record
 * @param {(id: string) => void} registered
 * @param {() => void} cancel
 */
function form(id, record, registered, cancel) {
  const attributes = { required: true, autocomplete: "off", autofocus: true, ...IDENTIFIER };
  const name = h("input", { id: "new-id", value: id, ...attributes });
  const inputs = SECTIONS.flatMap(([, fields]) => fields.map((shown) => inputOf(shown, record)));
  const answer = h("div", { "aria-live": "polite" });
  const submit = async (/** @type {SubmitEvent} */ event) => {
    event.preventDefault();
    const chosen = name.value.trim();
    try {
      await sendJson("POST", "/v1/clutches", recordOf(chosen, inputs, record));
      registered(chosen);
    } catch (problem) {
      answer.replaceChildren(problemView(problem, "Not registered. "));
    }
  };
  const sections = SECTIONS.map(([title, fields]) => {
    const own = inputs.filter((input) => fields.includes(input.field));
    const labelled = own.map(({ field: { label }, element }) => field(element, label));
    return h("fieldset", {}, h("legend", {}, title), h("div", { class: "fields" }, labelled));
  });
  return h(
    "form",
    { onsubmit: submit },
    h("div", { class: "fields" }, field(name, "Clutch id")),
    sections,
    answer,
    h("div", { class: "buttons" }, button("Cancel", cancel), h("button", { class: "main" }, "Register this clutch")),
  );
}

/** @typedef {{ field: Field, element: HTMLInputElement }} Input */

/** @type {(field: Field, record: ClutchRecord | null) => Input} */
function inputOf(field, record) {
  const { group, name, integer, text, optional } = field;
  const value = valueIn(record, field) ?? valueIn(DEFAULTS, field);
  const kind = text ? { maxlength: 100 } : { type: "number", step: integer ? 1 : "any", min: 0, inputmode: "decimal" };
  const attributes = { required: !optional, placeholder: optional, value: value ?? "", autocomplete: "off" };
  return { field, element: h("input", { id: `new-${group ?? "clutch"}-${name}`, ...kind, ...attributes }) };
}

/** @type {(record: ClutchRecord | null, field: Field) => string | number | null | undefined} */
function valueIn(record, { group, name }) {
  const values = /** @type {Record<string, any>} */ (record ?? {});
  return group === null ? values[name] : values[group]?.[name];
}

/**
 * The record as the form has it, beside what the form does not show.
 * @param {string} id
 * @param {Input[]} inputs
 * @param {ClutchRecord | null} record
 */
export function recordOf(id, inputs, record) {
  /** @type {Record<string, any>} */
  const body = { ...(record ?? {}), clutch_id: id };
  for (const { field, element } of inputs) {
    const value = field.text ? element.value.trim() : element.value === "" ? null : Number(element.value);
    if (field.group === null) body[field.name] = value;
    else body[field.group] = { ...body[field.group], [field.name]: value };
  }
  return body;
}
