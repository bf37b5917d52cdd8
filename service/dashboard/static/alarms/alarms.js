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

/** Events that are shown, and deliveries of each receiver; the lists of the API hold all. */
const SHOWN = 50;
const DELIVERIES = 10;
/** @type {Record<EventOut["state"], string>} */
const STATES = { raised: "Not acknowledged", acknowledged: "Acknowledged", cleared: "Over" };

/** @type {(place: HTMLElement, clutchId: string | null) => () => Promise<void>} of all clutches where it is null */
export function alarms(place, clutchId) {
  const [rulesStatus, receiversStatus] = [h("div", { role: "status" }), h("div", { role: "status" })];
  const events = h("section", { "aria-label": "Alarms" });
  const rules = h("section", { "aria-label": "Rules" });
  const receivers = h("section", { "aria-label": "Receivers" });
  place.replaceChildren(events, rules, receivers);
  let shown = "";

  async function show() {
    const of = clutchId === null ? "" : `&clutch_id=${encodeURIComponent(clutchId)}`;
    /** @type {[{ body: { items: EventOut[] } }, { items: AlarmOut[] }, { items: WebhookOut[] }]} */
    const [{ body }, allRules, allReceivers] = await Promise.all([
      read(`/v1/alarms/events?limit=${SHOWN}${of}`),
      readAll("/v1/alarms?limit=1000"),
      readAll("/v1/webhooks?limit=1000"),
    ]);
    const own = (/** @type {{ clutch_id: string | null }} */ { clutch_id: id }) =>
      clutchId === null || id === null || id === clutchId;
    const ownReceivers = allReceivers.items.filter(own);
    /** @type {{ body: { items: DeliveryOut[] } }[]} */
    const sent = await Promise.all(
      ownReceivers.map(({ webhook_id: id }) => read(`/v1/webhooks/${id}/deliveries?limit=${DELIVERIES}`)),
    );
    const deliveries = sent.map((each) => each.body.items);
    const text = JSON.stringify([body.items, allRules.items, ownReceivers, deliveries]);
    if (text === shown) return;
    shown = text;
    drawEvents(body.items);
    drawRules(allRules.items.filter(own));
    drawReceivers(ownReceivers, deliveries);
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
      const test = act("Test", () => tested(path, rulesStatus), text);
      const change = act("Change …", () => changed(rule), text);
      return [
        [rule.name && h("b", `${rule.name}: `), text, !rule.enabled && h("span.tag", "off")],
        rule.clutch_id ?? "all clutches",
        h(
          "div.row.buttons.start",
          test,
          change,
          act("Delete", () => told("DELETE", path, rulesStatus), text),
        ),
      ];
    });
    const all = table("Rules", ["An alarm when", "Of", "Action"], rows);
    rules.replaceChildren(
      ...listed("Rules", "No rule yet: nothing raises an alarm.", all),
      rulesStatus,
      button("New rule …", () => changed(null), { class: "main" }),
    );
  }

  /** @type {(own: WebhookOut[], deliveries: DeliveryOut[][]) => void} `deliveries`: the newest of each, the newest first */
  function drawReceivers(own, deliveries) {
    const rows = own.map(({ webhook_id: id, name, url, clutch_id: of }, index) => {
      const path = `/v1/webhooks/${id}`;
      return [
        name || "–",
        url,
        of ?? "all clutches",
        deliveries[index].length > 0 ? deliveriesView(url, deliveries[index]) : "nothing sent yet",
        h(
          "div.row.buttons.start",
          act("Test", () => tested(path, receiversStatus), url),
          act("Delete", () => told("DELETE", path, receiversStatus), url),
        ),
      ];
    });
    const all = table("Receivers", ["Name", "Address", "Of", "Deliveries", "Action"], rows);
    receivers.replaceChildren(
      ...listed("Receivers", "No receiver yet: alarms appear on this page only.", all),
      receiversStatus,
      button("New receiver …", async () => (await askReceiver(clutchId)) && show()),
    );
  }

  /** @type {(label: string, onclick: () => unknown, of: string) => HTMLButtonElement} `of`: what it is done to */
  const act = (label, onclick, of) => button(label, onclick, { class: "small", "aria-label": `${label}: ${of}` });

  /** @type {(path: string, status: HTMLElement) => Promise<void>} send a test, and say how it went */
  async function tested(path, status) {
    status.replaceChildren(quiet("Sending a test …"));
    const answer = await told("POST", `${path}/test`, status);
    if (answer) status.replaceChildren(h("p.notice", answer.body.message));
  }

  /** @param {AlarmOut | null} rule null: a new one */
  const changed = async (rule) => (await askRule(rule, clutchId)) && show();

  /** @type {(method: string, path: string, status: HTMLElement) => Promise<any>} null where it was refused, which `status` says */
  async function told(method, path, status) {
    try {
      const answer = await send(method, path, {});
      status.replaceChildren();
      await show();
      return answer;
    } catch (problem) {
      status.replaceChildren(problemView(problem, "Nothing was changed. "));
      return null;
    }
  }

  return show;
}

/** @param {EventOut} event */
const acknowledgedText = ({ acknowledged_by: by, note }) => `Acknowledged by ${by ?? ""}${note && `: ${note}`}`;

/** @type {(url: string, sent: DeliveryOut[]) => HTMLElement} how the newest went, and all of them below */
function deliveriesView(url, sent) {
  const rows = sent.map((each) => [
    moment(each.created_at),
    each.event_id === null ? "Test" : "Alarm",
    deliveryText(each),
  ]);
  return h(
    "details",
    h("summary", deliveryText(sent[0])),
    table(`Deliveries to ${url}`, ["Made", "What", "State"], rows),
  );
}

/** @param {DeliveryOut} delivery */
function deliveryText({ state, attempts, problem, delivered_at: at, next_attempt_at: next }) {
  if (state === "delivered") return `Delivered ${moment(at)}`;
  const reason = problem ? `: ${problem}` : "";
  if (state === "failed") return `Failed${reason}`;
  return `Waiting after ${attempts} ${attempts === 1 ? "attempt" : "attempts"}${reason}${next ? `; next ${moment(next)}` : ""}`;
}

/** @type {(title: string, empty: string, all: HTMLTableElement) => HTMLElement[]} a heading, and the rows or that there are none */
const listed = (title, empty, all) => [
  h("h2", title),
  all.tBodies[0].rows.length === 0 ? quiet(empty) : h("div.panel", scrolling(title, all)),
];
