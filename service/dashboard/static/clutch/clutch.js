// The page of one clutch: what is known and what to do stand first, then tabs that read their answers when they are opened.
// Open this file first, then head.js (the first lines), reader.js (what is read) and a tab: overview.js, curves.js, loops.js,
// runs.js, history.js; changes.js says what may be changed, report.js makes the printed page.

import { diagnosisTab } from "../diagnosis/diagnosis.js";
import { alarms } from "../alarms/alarms.js";
import { pollRaised } from "../alarms/raised.js";
import { engagementsTab } from "../engagements/engagements.js";
import { sender } from "../sending/taking.js";
import { readIfThere } from "../shared/api.js";
import { button, byId, h, markShown, redraw, showTab } from "../shared/dom.js";
import { Live } from "../shared/live.js";
import { placeUnits } from "../shared/units.js";
import { askArchive, askEnd, askTakeBack, showDone } from "./changes.js";
import { curvesTab } from "./curves.js";
import { head } from "./head.js";
import { historyTab } from "./history.js";
import { loopsTab } from "./loops.js";
import { overviewTab } from "./overview.js";
import { Reader } from "./reader.js";
import { makeReport } from "./report.js";
import { runsTab } from "./runs.js";

/** @import { Chart } from "../charts/chart.js" */
/** @import { Asked } from "./changes.js" */

/** @typedef {{ reader: Reader, done: (asked: Asked) => Promise<void> }} Page what every tab is given; `done`: changes something */

/**
 * @typedef {object} Tab
 * @property {(item: string) => Promise<void>} show reads and draws; `item` is what the address opens in it
 * @property {() => Promise<void>} [poll] looks for what changes without the clutch
 * @property {Chart[]} [charts] of the printed page
 */

const INTERVAL = 2000; // ms
const ID = decodeURIComponent(location.pathname.split("/").at(-1) ?? "");
document.title = `${ID} · Clutchlife`;
const reader = new Reader(ID);
const refresh = () => live.now();
/** @param {Asked} asked */
const done = async (asked) => showDone(await asked, refresh);
/** @type {Page} */
const page = { reader, done };

/** @type {Record<string, (place: HTMLElement) => Tab>} */
const TABS = {
  overview: (place) => overviewTab(place, page),
  diagnosis: (place) => diagnosisTab(place, reader, refresh),
  curves: (place) => curvesTab(place, page),
  loops: (place) => loopsTab(place, page),
  engagements: (place) => engagementsTab(place, reader),
  runs: (place) => runsTab(place, page),
  history: (place) => historyTab(place, page),
  alarms: (place) => {
    const show = alarms(place, ID);
    return { show, poll: show };
  },
};

for (const name of Object.keys(TABS)) byId("main").append(h("div", { id: `tab-${name}`, hidden: true }));

/** @type {Map<string, Tab>} those that were opened */
const opened = new Map();
/** @type {Map<string, string>} what each shows: the clutch as it was read, and what the address opens in it */
const shown = new Map();

/** The tab of the address, and the run that it opens. */
function wanted() {
  const [, name = "", ...rest] = location.hash.split("/");
  return { name: name in TABS ? name : "overview", item: text(rest.join("/")) };
}

/** @param {string} encoded */
function text(encoded) {
  try {
    return decodeURIComponent(encoded);
  } catch {
    return encoded; // no address of ours
  }
}

/** @param {string} name */
function tab(name) {
  const before = opened.get(name);
  if (before) return before;
  const made = TABS[name](byId(`tab-${name}`));
  opened.set(name, made);
  return made;
}

/** The tab of the address in sight; its answers follow. */
const turn = () => showTab(Object.keys(TABS), wanted().name);

async function poll() {
  const answer = await readIfThere(reader.path);
  if (answer === null) return showUnregistered();
  if (answer.body !== reader.clutch) {
    reader.renew(answer.body);
    drawHead(answer.body);
    byId("tabs").hidden = false;
    turn();
  }
  const { name, item } = wanted();
  const key = JSON.stringify([answer.body, item]);
  const part = tab(name);
  if (shown.get(name) === key) await part.poll?.();
  else await part.show(item);
  shown.set(name, key); // after all of it is read: an error midway is made good at the next poll
  await Promise.all([pollRaised(), name === "overview" && drawReport()]);
}

/** @param {ClutchOut} clutch */
function drawHead(clutch) {
  const asks = {
    archive: () => done(askArchive(ID, true)),
    end: endOrTakeBack,
    edit: () => done(editRecord(clutch)),
    copy: () => registerLike(clutch),
    refresh,
  };
  redraw(byId("head"), ...head(clutch, asks));
  markShown("head-shown");
  const back = button("Bring it back …", () => done(askArchive(ID, false)));
  const text = "This clutch is archived: it is not in the list of clutches and accepts no new runs.";
  byId("archived").replaceChildren(clutch.archived ? h("div.notice", h("p", text), back) : "");
  makeReport(byId("report"), { clutch });
}

/** @type {(clutch: ClutchOut) => Asked} */
const editRecord = async (clutch) => (await import("../sending/registration.js")).edit(clutch);

/** @param {ClutchOut} clutch */
async function registerLike(clutch) {
  const { copyOf, registerAndOpen } = await import("../sending/registration.js");
  await registerAndOpen(copyOf(clutch));
}

async function endOrTakeBack() {
  const { ended, as_of_cycles: cycles } = await reader.life();
  await done(ended === null ? askEnd(ID, cycles ?? 0) : askTakeBack(ID, ended));
}

/** The printed page, made beside the overview whenever that is drawn. */
async function drawReport() {
  const clutch = reader.present();
  if (clutch.runs === 0) return;
  const [life, tests, events] = await Promise.all([reader.life(), reader.tests(), reader.events()]);
  makeReport(byId("report"), { clutch, life, tests, events, charts: opened.get("overview")?.charts });
}

function showUnregistered() {
  const sentence = `No clutch is registered as “${ID}”. It appears here when it is registered. `;
  const link = h("a", { href: "/" }, "All clutches");
  byId("head").replaceChildren(h("div.notice.bad", h("h1", "No such clutch"), h("p", sentence, link)));
}

byId("print").addEventListener("click", async () => {
  if (reader.clutch !== null && reader.clutch.runs > 0) {
    await tab("overview").show("");
    await drawReport();
  }
  print();
});
addEventListener("hashchange", () => {
  turn();
  live.now();
});
const live = new Live(poll, INTERVAL);
sender(byId("send"), { clutch: ID, sent: () => live.now() });
placeUnits(byId("units"), () => {
  shown.clear();
  live.now();
});
turn();
live.now();
