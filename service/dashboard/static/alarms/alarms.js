// Alarms: events that wait for someone to acknowledge them, the rules that raise them, and the receivers that are called. Answers of
// the API go in; lists, a form and tests come out, of all clutches or of one. Open this file first, then form.js (a rule as a sentence
// and in a dialog).

import { pageOf, read, readAll, send } from "../shared/api.js";
import { button, h, quiet, scrolling, table } from "../shared/dom.js";
import { rowFiles } from "../shared/files.js";
import { counted, moment } from "../shared/format.js";
import { problemView } from "../shared/problem_view.js";
import { askReceiver, askRule, ruleText } from "./form.js";
import { askAcknowledge } from "./raised.js";

/** @import { Content } from "../shared/dom.js" */

/** Events that are shown, and deliveries of each receiver; the lists of the API hold all. */
const SHOWN = 50;
const DELIVERIES = 10;
/** @type {Record<EventOut["state"], string>} */
const STATES = { raised: "Not acknowledged", acknowledged: "Acknowledged", cleared: "Over" };

/** Of an alarm in saved files. */
const SAVED = /** @type {const} */ ([
  "raised_at",
  "clutch_id",
  "message",
  "state",
  "acknowledged_by",
  "note",
  "value",
  "limit",
]);

/** @type {(place: HTMLElement, clutchId: string | null) => () => Promise<void>} of all clutches where it is null */
export function alarms(place, clutchId) {
  place.replaceChildren();
  const raised = ["Raised", "Clutch", "What", "State", "Action"];
  const events = part("Alarms", raised, "No alarm has been raised.", "Alarms, the newest first");
  const rules = part("Rules", ["An alarm when", "Of", "Action"], "No rule yet: nothing raises an alarm.");
  const called = ["Name", "Address", "Of", "Deliveries", "Action"];
  const receivers = part("Receivers", called, "No receiver yet: alarms appear on this page only.");
  let shown = "";

  async function show() {
    const of = clutchId === null ? "" : `&clutch_id=${encodeURIComponent(clutchId)}`;
    const [{ body }, allRules, allReceivers] = await Promise.all([
      read(`/v1/alarms/events?limit=${SHOWN}${of}`),
      readAll("/v1/alarms?limit=1000"),
      readAll("/v1/webhooks?limit=1000"),
    ]);
    const own = (/** @type {{ clutch_id: string | null }} */ { clutch_id: id }) =>
      clutchId === null || id === null || id === clutchId;
    const ownReceivers = allReceivers.items.filter(own);
    const sent = await Promise.all(
      ownReceivers.map(({ webhook_id: id }) => read(`/v1/webhooks/${id}/deliveries?limit=${DELIVERIES}`)),
    );
    const deliveries = sent.map((each) => each.body.items);
    const text = JSON.stringify([body.items, allRules.items, ownReceivers, deliveries]);
    if (text === shown) return;
    shown = text;
    const header = SAVED.map((name) => name.replace("_id", "").replaceAll("_", " "));
    const saved = body.items.map((event) => SAVED.map((name) => event[name]));
    events.draw(body.items.map(eventRow), rowFiles("alarms", [header, ...saved]));
    const rule = button("New rule …", () => changed(null), { class: "main" });
    rules.draw(allRules.items.filter(own).map(ruleRow), rule);
    const receiver = button("New receiver …", async () => (await askReceiver(clutchId)) && show());
    receivers.draw(
      ownReceivers.map((each, index) => receiverRow(each, deliveries[index])),
      receiver,
    );
  }

  /** @param {EventOut} event */
  function eventRow(event) {
    const acknowledge = async () => (await askAcknowledge(event)) && show();
    return [
      moment(event.raised_at),
      h("a", { href: pageOf(event.clutch_id) }, event.clutch_id),
      event.message,
      event.state === "acknowledged" ? acknowledgedText(event) : STATES[event.state],
      event.state === "raised" && act("Acknowledge …", acknowledge, event.message),
    ];
  }

  /** @param {AlarmOut} rule */
  function ruleRow(rule) {
    const text = ruleText(rule);
    const change = act("Change …", () => changed(rule), text);
    return [
      [rule.name && h("b", `${rule.name}: `), text, !rule.enabled && h("span.tag", "off")],
      rule.clutch_id ?? "all clutches",
      rules.actions(`/v1/alarms/${rule.alarm_id}`, text, change),
    ];
  }

  /** @type {(receiver: WebhookOut, deliveries: DeliveryOut[]) => Content[]} `deliveries`: the newest first */
  function receiverRow({ webhook_id: id, name, url, clutch_id: of }, deliveries) {
    return [
      name || "–",
      url,
      of ?? "all clutches",
      deliveries.length > 0 ? deliveriesView(url, deliveries) : "nothing sent yet",
      receivers.actions(`/v1/webhooks/${id}`, url),
    ];
  }

  /** @param {AlarmOut | null} rule null: a new one */
  const changed = async (rule) => (await askRule(rule, clutchId)) && show();

  /** @type {(title: string, columns: string[], empty: string, caption?: string) => Part} a section with a list, and what became of an action below it */
  function part(title, columns, empty, caption = title) {
    const status = h("div", { role: "status" });
    const section = h("section", { "aria-label": title });
    place.append(section);

    /** @type {(method: string, path: string) => Promise<any>} null where it was refused */
    async function told(method, path) {
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

    /** @param {string} path send a test, and say how it went */
    async function tested(path) {
      status.replaceChildren(quiet("Sending a test …"));
      const answer = await told("POST", `${path}/test`);
      if (answer) status.replaceChildren(h("p.notice", answer.body.message));
    }

    return {
      draw: (rows, below) => {
        const list = rows.length > 0 && h("div.panel", scrolling(title, table(caption, columns, rows)));
        section.replaceChildren(h("h2", title), list || quiet(empty), status, below);
      },
      actions: (path, of, more = null) => {
        const [test, remove] = [() => tested(path), () => told("DELETE", path)];
        return h("div.row.buttons.start", act("Test", test, of), more, act("Delete", remove, of));
      },
    };
  }

  return show;
}

/**
 * @typedef {object} Part
 * @property {(rows: Content[][], below: Node) => void} draw
 * @property {(path: string, of: string, more?: Content) => HTMLElement} actions on what the path names; `of`: its name
 */

/** @type {(label: string, onclick: () => unknown, of: string) => HTMLButtonElement} `of`: what it is done to */
const act = (label, onclick, of) => button(label, onclick, { class: "small", "aria-label": `${label}: ${of}` });

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
  return `Waiting after ${counted(attempts, "attempt")}${reason}${next ? `; next ${moment(next)}` : ""}`;
}
