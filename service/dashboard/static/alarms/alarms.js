// @ts-check
// Alarms: events that wait for someone to acknowledge them, the rules that raise them, and the receivers that are called. Answers of
// the API go in; lists, a form and tests come out, of all clutches or of one. Open this file first, then form.js (a rule as a sentence
// and in a dialog).

import { read, readAll, sendJson } from "../shared/api.js";
import { button, h, quiet, scrolling, table } from "../shared/dom.js";
import { rowFiles } from "../shared/files.js";
import { moment } from "../shared/format.js";
import { problemView } from "../shared/problem_view.js";
import { askReceiver, askRule, ruleText } from "./form.js";

/** @import { AlarmOut, EventOut, TestedOut, WebhookOut } from "../shared/types.js" */

/** Events that are shown; the list of the API holds all. */
const SHOWN = 50;
/** @type {Record<EventOut["state"], string>} */
const STATES = { raised: "Not acknowledged", acknowledged: "Acknowledged", cleared: "Over" };

export class Alarms {
  /**
   * @param {HTMLElement} place
   * @param {string | null} clutchId null: of all clutches
   */
  constructor(place, clutchId) {
    this.clutchId = clutchId;
    this.wrong = h("div", { role: "status" });
    this.events = h("section", { "aria-label": "Alarms" });
    this.rules = h("section", { "aria-label": "Rules" });
    this.receivers = h("section", { "aria-label": "Receivers" });
    place.replaceChildren(this.wrong, this.events, this.rules, this.receivers);
    this.shown = "";
  }

  /** Read what has changed, and draw it. */
  async show() {
    const of = this.clutchId === null ? "" : `&clutch_id=${encodeURIComponent(this.clutchId)}`;
    /** @type {[{ body: { items: EventOut[] } }, { items: AlarmOut[] }, { items: WebhookOut[] }]} */
    const [{ body: events }, rules, receivers] = await Promise.all([
      read(`/v1/alarms/events?limit=${SHOWN}${of}`),
      readAll("/v1/alarms?limit=1000"),
      readAll("/v1/webhooks?limit=1000"),
    ]);
    const text = JSON.stringify([events.items, rules.items, receivers.items]);
    if (text === this.shown) return;
    this.shown = text;
    const own = (/** @type {{ clutch_id: string | null }} */ { clutch_id: id }) =>
      this.clutchId === null || id === null || id === this.clutchId;
    this.drawEvents(events.items);
    this.drawRules(rules.items.filter(own));
    this.drawReceivers(receivers.items.filter(own));
  }

  /** @param {EventOut[]} events */
  drawEvents(events) {
    const rows = events.map((event) => [
      moment(event.raised_at),
      h("a", { href: `/clutches/${encodeURIComponent(event.clutch_id)}` }, event.clutch_id),
      event.message,
      event.state === "acknowledged" ? `Acknowledged by ${event.acknowledged_by ?? ""}` : STATES[event.state],
      event.state === "raised" && this.button("Acknowledge", () => this.acknowledge(event), event.message),
    ]);
    const columns = ["Raised", "Clutch", "What", "State", "Action"];
    this.events.replaceChildren(
      ...listed("Alarms", "No alarm has been raised.", table("Alarms, the newest first", columns, rows)),
      rowFiles("alarms", [
        ["raised at", "clutch", "message", "state", "acknowledged by", "value", "limit"],
        ...events.map((e) => [e.raised_at, e.clutch_id, e.message, e.state, e.acknowledged_by, e.value, e.limit]),
      ]),
    );
  }

  /** @param {AlarmOut[]} rules */
  drawRules(rules) {
    const rows = rules.map((rule) => [
      [rule.name && h("b", {}, `${rule.name}: `), ruleText(rule), !rule.enabled && h("span", { class: "tag" }, "off")],
      rule.clutch_id ?? "all clutches",
      h(
        "div",
        { class: "buttons start" },
        this.button("Test", () => this.test(rule), ruleText(rule)),
        this.button("Change …", () => this.change(rule), ruleText(rule)),
        this.button("Delete", () => this.send("DELETE", `/v1/alarms/${rule.alarm_id}`), ruleText(rule)),
      ),
    ]);
    this.rules.replaceChildren(
      ...listed(
        "Rules",
        "No rule yet: nothing raises an alarm.",
        table("Rules", ["An alarm when", "Of", "Action"], rows),
      ),
      button("New rule …", () => this.change(null), { class: "main" }),
    );
  }

  /** @param {WebhookOut[]} receivers */
  drawReceivers(receivers) {
    const rows = receivers.map(({ webhook_id: id, name, url, clutch_id: of }) => [
      name || "–",
      url,
      of ?? "all clutches",
      this.button("Delete", () => this.send("DELETE", `/v1/webhooks/${id}`), url),
    ]);
    const add = async () => {
      const receiver = await askReceiver(this.clutchId);
      if (receiver !== null) await this.send("POST", "/v1/webhooks", receiver);
    };
    const columns = ["Name", "Address", "Of", "Action"];
    this.receivers.replaceChildren(
      ...listed("Receivers", "No receiver yet: alarms appear on this page only.", table("Receivers", columns, rows)),
      button("New receiver …", add),
    );
  }

  /** @type {(label: string, onclick: () => unknown, of: string) => HTMLButtonElement} `of`: what it is done to */
  button(label, onclick, of) {
    return button(label, onclick, { class: "small", "aria-label": `${label}: ${of}` });
  }

  /** @param {EventOut} event */
  acknowledge(event) {
    return this.send("POST", `/v1/alarms/events/${event.event_id}/acknowledge`, { note: "" });
  }

  /** @param {AlarmOut} rule */
  async test(rule) {
    /** @type {{ body: TestedOut } | null} */
    const tested = await this.send("POST", `/v1/alarms/${rule.alarm_id}/test`, {});
    if (tested) this.wrong.replaceChildren(h("p", { class: "notice" }, tested.body.message));
  }

  /** @param {AlarmOut | null} rule null: a new one */
  async change(rule) {
    const wanted = await askRule(rule, this.clutchId);
    if (wanted === null) return;
    if (rule === null) await this.send("POST", "/v1/alarms", wanted);
    else await this.send("PUT", `/v1/alarms/${rule.alarm_id}`, wanted);
  }

  /** @type {(method: string, path: string, body?: object) => Promise<any>} null where it was refused, which is said */
  async send(method, path, body) {
    this.wrong.replaceChildren();
    try {
      const answer = await sendJson(method, path, body ?? {});
      await this.show();
      return answer;
    } catch (problem) {
      this.wrong.replaceChildren(problemView(problem, "Nothing was changed. "));
      return null;
    }
  }
}

/** @type {(title: string, empty: string, all: HTMLTableElement) => HTMLElement[]} a heading, and the rows or that there are none */
const listed = (title, empty, all) => [
  h("h2", {}, title),
  all.tBodies[0].rows.length === 0 ? quiet(empty) : h("div", { class: "panel" }, scrolling(title, all)),
];
