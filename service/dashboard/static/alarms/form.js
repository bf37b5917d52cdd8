// @ts-check
// Questions of the alarms' page: a rule, a receiver. Each resolves to what is to be sent, null where it is left.

import { answered, field, h } from "../shared/dom.js";
import { numberOf, NOT_A_NUMBER } from "../shared/format.js";
import { WATCHED } from "./words.js";

/** @import { Content } from "../shared/dom.js" */
/** @import { AlarmOut } from "../shared/types.js" */
/** @import { Watched } from "./words.js" */

/**
 * A form in a dialog; `read` gives what is to be sent, or says why it cannot yet.
 * @param {string} title
 * @param {Content} fields
 * @param {() => object | string} read
 * @returns {Promise<object | null>}
 */
function question(title, fields, read) {
  const wrong = h("p", { class: "wrong", role: "alert" });
  /** @type {object | null} */
  let result = null;
  const dialog = h("dialog", { class: "narrow", "aria-labelledby": "alarm-title" });
  const submit = (/** @type {Event} */ event) => {
    event.preventDefault();
    const wanted = read();
    if (typeof wanted === "string") {
      wrong.textContent = wanted;
      return;
    }
    result = wanted;
    dialog.close();
  };
  const cancel = h("button", { type: "button", onclick: () => dialog.close() }, "Cancel");
  dialog.append(
    h("h2", { id: "alarm-title" }, title),
    h(
      "form",
      { onsubmit: submit },
      h("div", { class: "fields" }, fields),
      wrong,
      h("div", { class: "buttons" }, cancel, h("button", { class: "main" }, "Save")),
    ),
  );
  return answered(dialog, () => result);
}

/**
 * @param {string} id
 * @param {string} value
 */
const input = (id, value) => h("input", { id, value, autocomplete: "off" });

/**
 * @param {AlarmOut | null} rule null: a new one
 * @param {string | null} clutchId of a clutch's page
 */
export function askRule(rule, clutchId) {
  const names = /** @type {Watched[]} */ (Object.keys(WATCHED));
  const first = rule?.quantity ?? "remaining_cycles";
  const options = names.map((name) => h("option", { value: name, selected: name === first }, WATCHED[name].title));
  const quantity = h("select", { id: "alarm-quantity" }, options);
  const limit = input("alarm-limit", String(rule?.below ?? rule?.above ?? WATCHED[first].limit));
  const share = input("alarm-hysteresis", String(100 * (rule?.hysteresis ?? 0.1)));
  const name = input("alarm-name", rule?.name ?? "");
  const clutch = input("alarm-clutch", rule ? (rule.clutch_id ?? "") : (clutchId ?? ""));
  const enabled = h("input", { id: "alarm-enabled", type: "checkbox", checked: rule?.enabled ?? true });
  const limits = h("div", { class: "fields" });
  const watched = () => WATCHED[/** @type {Watched} */ (quantity.value)];
  const draw = () => {
    const { side, unit } = watched();
    limits.hidden = side === null;
    limits.replaceChildren(
      field(limit, `${side === "above" ? "Above" : "Below"}${unit && `, ${unit}`}`),
      field(share, "Hysteresis, % of the limit: the alarm ends when the value is back by this much"),
    );
  };
  quantity.addEventListener("change", () => {
    limit.value = watched().limit;
    draw();
  });
  draw();
  const fields = [
    field(quantity, "An alarm when"),
    limits,
    field(clutch, "Clutch (empty: all clutches)"),
    field(name, "Name (optional)"),
    h("label", { class: "switch" }, enabled, "In use"),
  ];
  return question(rule === null ? "New rule" : "Change the rule", fields, () => {
    const { side } = watched();
    const [at, back] = [numberOf(limit.value), numberOf(share.value)];
    if (side !== null && (typeof at !== "number" || typeof back !== "number")) return NOT_A_NUMBER;
    return {
      name: name.value.trim(),
      quantity: quantity.value,
      ...(side === null ? {} : { [side]: at, hysteresis: (back ?? 0) / 100 }),
      ...(clutch.value.trim() ? { clutch_id: clutch.value.trim() } : {}),
      ...(rule
        ? { probability: rule.probability, speed_rpm: rule.speed_rpm, any_of: rule.any_of, kind: rule.kind }
        : {}),
      enabled: enabled.checked,
    };
  });
}

/** @param {string | null} clutchId of a clutch's page */
export function askReceiver(clutchId) {
  const url = h("input", { id: "receiver-url", type: "text", required: true, autocomplete: "off" });
  const name = input("receiver-name", "");
  const about = "https:// for a signed webhook; with the extra notify also mailtos://, msteams://, slack://, ntfys://";
  return question(
    "New receiver",
    [field(url, "Address", h("small", {}, about)), field(name, "Name (optional)")],
    () => ({
      url: url.value.trim(),
      name: name.value.trim(),
      ...(clutchId === null ? {} : { clutch_id: clutchId }),
    }),
  );
}
