// A clutch is registered, or its record edited, by a form that is submitted, never by a name that was typed: all its values are
// shown first.

import { at, clutchPath, pageOf, send } from "../shared/api.js";
import { asked } from "../shared/dialog.js";
import { button, field, h, numberInput, quiet } from "../shared/dom.js";
import { criteriaForm } from "./criteria_form.js";

/** @import { Done } from "../clutch/changes.js" */

/** @typedef {{ [Key in keyof ClutchIn]?: Partial<ClutchIn[Key]> }} ClutchRecord a clutch as the API takes it */

export const IDENTIFIER = {
  pattern: "[A-Za-z0-9][A-Za-z0-9._:@+\\-]{0,127}",
  title: "letters, digits and . _ : @ + -",
};

/** @typedef {string | number | null} Typed */
/** @typedef {[path: string, label: string, usual: Typed, attributes?: Record<string, Typed | boolean>]} Field of the record */

/** @type {[string, Field[]][]} with the reference clutch's values, as the service fills in what is left out */
export const SECTIONS = [
  [
    "Geometry",
    [
      ["geometry.inner_diameter_mm", "Inner diameter, mm", 99],
      ["geometry.outer_diameter_mm", "Outer diameter, mm", 133],
      ["geometry.friction_faces", "Friction faces", 2, { step: 1 }],
      ["geometry.mean_radius_mm", "Mean radius, mm", null, { required: false, placeholder: "from the diameters" }],
      ["geometry.pressure_factor", "Lining pressure divided by line pressure", 1],
    ],
  ],
  [
    "Oil",
    [
      ["oil.kinematic_viscosity_40c_cst", "Viscosity at 40 °C, cSt", 56],
      ["oil.kinematic_viscosity_100c_cst", "Viscosity at 100 °C, cSt", 9.3],
      ["fluid", "Fluid", "ATF"],
    ],
  ],
  [
    "Materials",
    [
      ["friction_material", "Friction material", "paper"],
      ["reaction_plate", "Reaction plate", "steel"],
    ],
  ],
  ["End of life", [["end_of_life.cof_fraction", "Mean COF as a share of its value when new, 0 to 1", 0.5]]],
  [
    "Note",
    [["note", "Where the clutch comes from, or what else is known of it", "", { required: false, maxlength: 500 }]],
  ],
];

/** What a clutch's record consists of, beside its id. */
const RECORD = /** @type {const} */ ([
  "geometry",
  "oil",
  "end_of_life",
  "friction_material",
  "reaction_plate",
  "fluid",
  "severity",
  "torque_filter_ms",
  "origin",
  "note",
]);

/** @type {(clutch: ClutchOut) => ClutchRecord} its record, for another one like it */
export const copyOf = (clutch) => Object.fromEntries(RECORD.map((name) => [name, clutch[name]]));

/**
 * The fields of a record in their sections, and the record as it is typed; other values at first.
 * @param {ClutchRecord | null} record
 */
function recordForm(record) {
  /** @type {[string, HTMLInputElement][]} by their place in the record */
  const inputs = [];
  const criteria = criteriaForm(/** @type {Partial<CriterionIn>[]} */ (record?.end_of_life?.criteria ?? []));
  const sections = SECTIONS.map(([title, fields]) => {
    const labelled = fields.map((each) => {
      const input = inputOf(each, record);
      inputs.push([each[0], input]);
      return field(input, each[1]);
    });
    return h("fieldset", h("legend", title), h("div.fields", labelled), title === "End of life" && criteria.element);
  });
  return { sections, value: () => recordOf(inputs, record, criteria.value()) };
}

/** @type {(clutch: ClutchOut) => Promise<Done | null>} edit a clutch's record: what differs is sent, with the reason */
export function edit(clutch) {
  const { sections, value } = recordForm(copyOf(clutch));
  const before = value();
  const reason = h("input", { id: "edit-reason", required: true, maxlength: 500 });
  const path = clutchPath(clutch.clutch_id);
  return asked({
    title: `Record of ${clutch.clutch_id}`,
    size: "registration",
    lines: [quiet("All results are computed again with the new values. The audit trail keeps the old ones.")],
    fields: [sections, field(reason, "Reason, for the audit trail")],
    action: "Change the record",
    send: async () => {
      const after = value();
      const changed = RECORD.filter((name) => JSON.stringify(after[name]) !== JSON.stringify(before[name]));
      if (changed.length === 0) return { text: "The record is as it was.", undo: null };
      /** @type {(values: Record<string, unknown>, why: string) => Promise<unknown>} */
      const put = (values, why) =>
        send("PATCH", path, { ...Object.fromEntries(changed.map((name) => [name, values[name]])), reason: why });
      await put(after, reason.value.trim());
      const undo = async () => {
        await put(before, "the change is undone");
        return { text: `The record of ${clutch.clutch_id} is as it was.`, undo: null };
      };
      return { text: `The record of ${clutch.clutch_id} is changed.`, undo };
    },
  });
}

/**
 * The form in a dialog; resolves to the clutch to go on with: the one that was registered, one of `similar`, or null where
 * the reader leaves it.
 * @param {string} id
 * @param {{ similar?: string[], record?: ClutchRecord | null, lead?: string }} [options] registered names, one of which may be
 *   meant; other values at first; why the form is shown
 * @returns {Promise<string | null>}
 */
export async function register(id, { similar = [], record = null, lead = "" } = {}) {
  const attributes = { required: true, autofocus: true, ...IDENTIFIER };
  const name = h("input", { id: "new-id", value: id, ...attributes });
  const { sections, value } = recordForm(record);
  /** @type {string | null} */
  let meant = null;
  const others = similar.map((other) =>
    button(`Send to ${other} instead`, ({ target }) => {
      meant = other;
      target.closest("dialog").close();
    }),
  );
  const registered = await asked({
    title: "Register a clutch",
    size: "registration",
    lines: [
      lead && h("p.notice", lead),
      others.length > 0 && h("p.row.buttons.start", others),
      quiet(
        `These are the values of ${record ? "the other" : "the reference"} clutch. Change the values that differ on your clutch.`,
      ),
    ],
    fields: [field(name, "Clutch id"), sections],
    action: "Register this clutch",
    lead: "Not registered. ",
    send: async () => {
      const chosen = name.value.trim();
      await send("POST", "/v1/clutches", { ...value(), clutch_id: chosen });
      return chosen;
    },
  });
  return meant ?? registered;
}

/** @type {(record?: ClutchRecord) => Promise<void>} register a clutch, and open its page */
export async function registerAndOpen(record) {
  const id = await register("", { record });
  if (id !== null) location.assign(at(pageOf(id)));
}

/** @type {(field: Field, record: ClutchRecord | null) => HTMLInputElement} */
function inputOf([path, , usual, attributes], record) {
  const own = path.split(".").reduce((value, name) => value?.[name], /** @type {any} */ (record));
  const all = { id: `new-${path.replace(".", "-")}`, required: true, value: own ?? usual ?? "" };
  return typeof usual === "string"
    ? h("input", { ...all, maxlength: 100, ...attributes })
    : numberInput({ ...all, min: 0, ...attributes });
}

/** @type {(inputs: [string, HTMLInputElement][], record: ClutchRecord | null, criteria: object[]) => Record<string, any>} */
function recordOf(inputs, record, criteria) {
  /** @type {Record<string, any>} */
  const body = { ...record, end_of_life: { ...record?.end_of_life, criteria } };
  for (const [path, { type, value: typed }] of inputs) {
    const [name, group] = path.split(".").reverse();
    const value = type !== "number" ? typed.trim() : typed === "" ? null : Number(typed);
    if (group === undefined) body[name] = value;
    else body[group] = { ...body[group], [name]: value };
  }
  return body;
}
