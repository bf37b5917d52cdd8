// Alarms that nobody has acknowledged: their number in the bar of every page and in a clutch's row, and themselves in a clutch's
// head. An alarm is acknowledged with a note.

import { read, send } from "../shared/api.js";
import { asked } from "../shared/dialog.js";
import { button, byId, field, h } from "../shared/dom.js";
import { counted } from "../shared/format.js";

/** @type {(count: number) => void} the number in the bar */
export function showRaised(count) {
  const link = byId("raised");
  link.hidden = count === 0;
  const text = counted(count, "alarm");
  if (link.textContent !== text) link.textContent = text;
}

/** The number in the bar of a page that reads nothing else of all clutches. */
export async function pollRaised() {
  const { body } = await read("/v1/fleet/totals");
  showRaised(body.alarms);
}

/** @type {(alarms: EventOut[], href: string) => HTMLElement | false} the number in a clutch's row */
export const raisedLink = (alarms, href) =>
  alarms.length > 0 &&
  h("a.raised", { href, title: alarms.map(({ message }) => message).join("\n") }, counted(alarms.length, "alarm"));

/** @type {(alarms: EventOut[], done: () => unknown) => HTMLElement[]} themselves, in a clutch's head */
export const raisedNotices = (alarms, done) =>
  alarms.map((alarm) => {
    const acknowledge = async () => (await askAcknowledge(alarm)) && done();
    const message = alarm.message.replace(`${alarm.clutch_id}: `, "");
    return h(
      "p.notice.bad.row",
      h("b", `Alarm${alarm.name && ` “${alarm.name}”`}:`),
      h("span.message", message),
      button("Acknowledge …", acknowledge, { class: "small", "aria-label": `Acknowledge: ${message}` }),
    );
  });

/** @param {EventOut} alarm */
export function askAcknowledge({ event_id: id, message }) {
  const note = h("input", { id: "note", autocomplete: "off" });
  return asked({
    title: "Acknowledge the alarm",
    lines: [h("p", message)],
    fields: field(note, "Note: what was found or will be done (optional)"),
    action: "Acknowledge",
    send: () => send("POST", `/v1/alarms/events/${id}/acknowledge`, { note: note.value.trim() }),
  });
}
