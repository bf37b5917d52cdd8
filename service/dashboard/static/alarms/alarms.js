// Alarms: events that wait for someone to acknowledge them, the rules that raise them, and the receivers that are called. Answers of
// the API go in; lists, a form and tests come out, of all clutches or of one. Open this file first, then form.js (a rule as a sentence
// and in a dialog).

import { read, readAll, send } from "../shared/api.js";
import { button, h, quiet, scrolling, table } from "../shared/dom.js";
import { rowFiles } from "../shared/files.js";
import { moment } from "../shared/format.js";
import { problemView } from "../shared/problem_view.js";
import { askReceiver, askRule, ruleText } from "./form.js";
import { askAcknowledge } from "./raised.js";

/** Events that are shown; the list of the API holds all. */
const SHOWN = 50;
/** @type {Record<EventOut["state"], string>} */
const STATES = { raised: "Not acknowledged", acknowledged: "Acknowledged", cleared: "Over" };

/** @type {(place: HTMLElement, clutchId: string | null) => () => Promise<void>} of all clutches where it is null */
export function alarms(place, clutchId) {
  const wrong = h("div", { role: "status" });
  const events = h("section", { "aria-label": "Alarms" });
  const rules = h("section", { "aria-label": "Rules" });
  const receivers = h("section", { "aria-label": "Receivers" });
  place.replaceChildren(wrong, events, rules, receivers);
  let shown = "";

  async function show() {
    const of = clutchId === null ? "" : `&clutch_id=${encodeURIComponent(clutchId)}`;
    /** @type {[{ body: { items: EventOut[] } }, { items: AlarmOut[] }, { items: WebhookOut[] }]} */
    const [{ body }, allRules, allReceivers] = await Promise.all([
      read(`/v1/alarms/events?limit=${SHOWN}${of}`),
      readAll("/v1/alarms?limit=1000"),
      readAll("/v1/webhooks?limit=1000"),
    ]);
    const text = JSON.stringify([body.items, allRules.items, allReceivers.items]);
    if (text === shown) return;
    shown = text;
    const own = (/** @type {{ clutch_id: string | null }} */ { clutch_id: id }) =>
      clutchId === null || id === null || id === clutchId;
    drawEvents(body.items);
    drawRules(allRules.items.filter(own));
    drawReceivers(allReceivers.items.filter(own));
  }

  /** @param {EventOut[]} raised */
  function drawEvents(raised) {
    const acknowledge = async (/** @type {EventOut} */ event) => (await askAcknowledge(event)) && show();
    const rows = raised.map((event) => [
      moment(event.raised_at),
      h("a", { href: `/clutches/${encodeURIComponent(event.clutch_id)}` }, event.clutch_id),
      event.message,
      event.state === "acknowledged" ? acknowledgedText(event) : STATES[event.state],
      event.state === "raised" && act("Acknowledge …", () => acknowledge(event), event.message),
    ]);
    const columns = ["Raised", "Clutch", "What", "State", "Action"];
    events.replaceChildren(
      ...listed("Alarms", "No alarm has been raised.", table("Alarms, the newest first", columns, rows)),
      rowFiles("alarms", [
        ["raised at", "clutch", "message", "state", "acknowledged by", "note", "value", "limit"],
        ...raised.map((e) => [
          e.raised_at,
          e.clutch_id,
          e.message,
          e.state,
          e.acknowledged_by,
          e.note,
          e.value,
          e.limit,
        ]),
      ]),
    );
  }

  /** @param {AlarmOut[]} own */
  function drawRules(own) {
    const rows = own.map((rule) => {
      const text = ruleText(rule);
      const path = `/v1/alarms/${rule.alarm_id}`;
      const test = act("Test", async () => say(await told("POST", `${path}/test`, {})), text);
      const change = act("Change …", () => changed(rule), text);
      return [
        [rule.name && h("b", `${rule.name}: `), text, !rule.enabled && h("span.tag", "off")],
        rule.clutch_id ?? "all clutches",
        h(
          "div.row.buttons.start",
          test,
          change,
          act("Delete", () => told("DELETE", path), text),
        ),
      ];
    });
    const all = table("Rules", ["An alarm when", "Of", "Action"], rows);
    rules.replaceChildren(
      ...listed("Rules", "No rule yet: nothing raises an alarm.", all),
      button("New rule …", () => changed(null), { class: "main" }),
    );
  }

  /** @param {WebhookOut[]} own */
  function drawReceivers(own) {
    const rows = own.map(({ webhook_id: id, name, url, clutch_id: of }) => [
      name || "–",
      url,
      of ?? "all clutches",
      act("Delete", () => told("DELETE", `/v1/webhooks/${id}`), url),
    ]);
    const add = async () => {
      const receiver = await askReceiver(clutchId);
      if (receiver !== null) await told("POST", "/v1/webhooks", receiver);
    };
    const all = table("Receivers", ["Name", "Address", "Of", "Action"], rows);
    receivers.replaceChildren(
      ...listed("Receivers", "No receiver yet: alarms appear on this page only.", all),
      button("New receiver …", add),
    );
  }

  /** @type {(label: string, onclick: () => unknown, of: string) => HTMLButtonElement} `of`: what it is done to */
  const act = (label, onclick, of) => button(label, onclick, { class: "small", "aria-label": `${label}: ${of}` });

  /** @param {{ body: TestedOut } | null} tested */
  const say = (tested) => tested && wrong.replaceChildren(h("p.notice", tested.body.message));

  /** @param {AlarmOut | null} rule null: a new one */
  async function changed(rule) {
    const wanted = await askRule(rule, clutchId);
    if (wanted === null) return;
    if (rule === null) await told("POST", "/v1/alarms", wanted);
    else await told("PUT", `/v1/alarms/${rule.alarm_id}`, wanted);
  }

  /** @type {(method: string, path: string, body?: object) => Promise<any>} null where it was refused, which is said */
  async function told(method, path, body = {}) {
    wrong.replaceChildren();
    try {
      const answer = await send(method, path, body);
      await show();
      return answer;
    } catch (problem) {
      wrong.replaceChildren(problemView(problem, "Nothing was changed. "));
      return null;
    }
  }

  return show;
}

/** @param {EventOut} event */
const acknowledgedText = ({ acknowledged_by: by, note }) => `Acknowledged by ${by ?? ""}${note && `: ${note}`}`;

/** @type {(title: string, empty: string, all: HTMLTableElement) => HTMLElement[]} a heading, and the rows or that there are none */
const listed = (title, empty, all) => [
  h("h2", title),
  all.tBodies[0].rows.length === 0 ? quiet(empty) : h("div.panel", scrolling(title, all)),
];
