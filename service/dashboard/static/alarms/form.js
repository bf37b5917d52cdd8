// What a rule of an alarm watches, a rule as part of a sentence, and the questions of the alarms' page: a rule, a receiver. Each
// sends what is typed, which stays where the service refuses it.

import { send } from "../shared/api.js";
import { asked } from "../shared/dialog.js";
import { field, h, offered, select } from "../shared/dom.js";
import { fixed, percent, significant, words } from "../shared/format.js";
import { numbersOf } from "../shared/problem_view.js";

/** @typedef {AlarmOut["quantity"]} Watched */

/** @type {Record<Watched, { title: string, side: "below" | "above" | null, unit: string, limit: string }>} */
const WATCHED = {
  remaining_cycles: { title: "Remaining cycles, safe bound", side: "below", unit: "cycles", limit: "4000" },
  remaining_days: { title: "Remaining days at the pace so far", side: "below", unit: "days", limit: "14" },
  health: { title: "Health", side: "below", unit: "", limit: "0.2" },
  shudder_margin: { title: "Shudder margin dμ/dv", side: "below", unit: "s/m", limit: "0" },
  held_runs: { title: "Held runs", side: "above", unit: "", limit: "0" },
  off_course: { title: "A test that does not fit the earlier ones", side: null, unit: "", limit: "" },
  verdict: { title: "A new verdict: data and model disagree", side: null, unit: "", limit: "" },
  state: { title: "Any state but normal", side: null, unit: "", limit: "" },
  silent_hours: { title: "Hours since the last run", side: "above", unit: "h", limit: "24" },
};

/** @type {(rule: AlarmOut) => string} when a rule raises an alarm */
export function ruleText({ quantity, below, above, probability, any_of: names, median_within: within }) {
  const { title, side, unit } = WATCHED[quantity];
  if (side === null) return names ? `${title} (${names.map((name) => words(name).toLowerCase()).join(", ")})` : title;
  const limit = below ?? above ?? 0;
  const value = quantity === "health" ? percent(limit) : Math.abs(limit) >= 100 ? fixed(limit) : significant(limit, 3);
  const sure = probability === 0.05 ? "" : `, ${percent(probability)} quantile`;
  const shown = hasMedian(quantity) && within !== null ? `, median below ${within} times that` : "";
  return `${title} ${side} ${value}${unit && ` ${unit}`}${sure}${shown}`;
}

/** @type {(quantity: string) => boolean} remaining life has a median beside its bound */
const hasMedian = (quantity) => quantity.startsWith("remaining");

/** @type {(name: string, value: string) => HTMLInputElement} `name`: of the field that is sent */
const input = (name, value) => h("input", { id: `alarm-${name}`, name, value });

/** @param {HTMLInputElement} input a number, null where nothing is typed */
const typed = (input) => numbersOf([input])[0];

/**
 * @param {AlarmOut | null} rule null: a new one
 * @param {string | null} clutchId of a clutch's page
 */
export function askRule(rule, clutchId) {
  const first = rule?.quantity ?? "remaining_cycles";
  const options = offered(Object.keys(WATCHED), (name) => WATCHED[/** @type {Watched} */ (name)].title);
  const quantity = select({ id: "alarm-quantity" }, options, first);
  const limit = input("limit", String(rule?.below ?? rule?.above ?? WATCHED[first].limit));
  const share = input("hysteresis", String(100 * (rule?.hysteresis ?? 0.1)));
  const within = input("median_within", String((rule ? rule.median_within : 2) ?? ""));
  const name = input("name", rule?.name ?? "");
  const clutch = input("clutch_id", rule ? (rule.clutch_id ?? "") : (clutchId ?? ""));
  const enabled = h("input", { id: "alarm-enabled", type: "checkbox", checked: rule?.enabled ?? true });
  const limits = h("div.fields");
  const watched = () => WATCHED[/** @type {Watched} */ (quantity.value)];
  const draw = () => {
    const { side, unit } = watched();
    limits.hidden = side === null;
    limit.name = side ?? "";
    const about = h("small", "With few tests the bound is low and the median high. Empty: the bound alone decides.");
    limits.replaceChildren(
      field(limit, `${side === "above" ? "Above" : "Below"}${unit && `, ${unit}`}`),
      hasMedian(quantity.value) ? field(within, "… and the median below so many times that", about) : "",
      field(share, "Hysteresis, % of the limit: the alarm ends when the value is within the limit by this much"),
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
    h("label.switch", enabled, "In use"),
  ];
  const save = () => {
    const { side } = watched();
    const body = {
      name: name.value.trim(),
      quantity: quantity.value,
      ...(side === null ? {} : { [side]: typed(limit), hysteresis: (typed(share) ?? 0) / 100 }),
      ...(hasMedian(quantity.value) ? { median_within: typed(within) } : {}),
      ...(clutch.value.trim() ? { clutch_id: clutch.value.trim() } : {}),
      ...(rule
        ? { probability: rule.probability, speed_rpm: rule.speed_rpm, any_of: rule.any_of, kind: rule.kind }
        : {}),
      enabled: enabled.checked,
    };
    return rule ? send("PUT", `/v1/alarms/${rule.alarm_id}`, body) : send("POST", "/v1/alarms", body);
  };
  return asked({ title: rule === null ? "New rule" : "Change the rule", fields, action: "Save", send: save });
}

/** @param {string | null} clutchId of a clutch's page */
export function askReceiver(clutchId) {
  const url = h("input", { id: "receiver-url", name: "url", type: "text", required: true });
  const name = input("name", "");
  const about = "https:// for a signed webhook; with the extra notify also mailtos://, msteams://, slack://, ntfys://";
  const fields = [field(url, "Address", h("small", about)), field(name, "Name (optional)")];
  const save = () =>
    send("POST", "/v1/webhooks", {
      url: url.value.trim(),
      name: name.value.trim(),
      ...(clutchId === null ? {} : { clutch_id: clutchId }),
    });
  return asked({ title: "New receiver", fields, action: "Save", send: save });
}
