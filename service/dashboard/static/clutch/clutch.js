// @ts-check
// The page of one clutch: its answers of the API are read when they change, and shown in sections that are drawn when seen.
// Open this file first, then head.js (its state in one look), board.js (its charts and their choices), planned_duty.js, stored.js (its runs,
// warnings and changes) and report.js (the printed page).

import { Diagnosis } from "../diagnosis/diagnosis.js";
import { Inspections } from "../inspections/inspections.js";
import { criteriaTable } from "../quantities/criteria.js";
import { RemainingBy } from "../quantities/remaining.js";
import { sender } from "../sending/sending.js";
import { clutchPath, Problem, read, readAll } from "../shared/api.js";
import { byId, h, within } from "../shared/dom.js";
import { withKey } from "../shared/key.js";
import { Live } from "../shared/live.js";
import { liveBar } from "../shared/live_bar.js";
import { firstRun } from "../shared/welcome.js";
import { Board } from "./board.js";
import { head } from "./head.js";
import { PlannedDuty } from "./planned_duty.js";
import { makeReport } from "./report.js";
import { counts } from "./states.js";
import { Stored } from "./stored.js";

/** @import { ClutchOut, DegradationItem, LoopItem, Receipt, RemainingLife, SeriesItem, StribeckItem, Warned } from "../shared/types.js" */
/** @import { Answers } from "./board.js" */

const ID = decodeURIComponent(location.pathname.split("/").at(-1) ?? "");
const PATH = clutchPath(ID);
const INTERVAL = 2000; // ms
const SECTIONS = ["life", "diagnosis", "stribeck", "parameters", "shudder", "loops", "lag", "engagements", "runs"];
/** @type {Receipt[]} before the runs are read */
const NO_EVENTS = [];
const fileName = () => ID.replaceAll(/[^\w.-]+/g, "_");

/**
 * What is shown now.
 * @type {Answers | null}
 */
let shown = null;
let due = true;
/**
 * The clutch as it was read last: another part of the page may have read a newer one meanwhile.
 * @type {ClutchOut | null}
 */
let latest = null;
/**
 * The page's parts, once there is something to put into them.
 * @type {{ board: Board, diagnosis: Diagnosis, remaining: RemainingBy } | null}
 */
let parts = null;
document.title = `${ID} · Clutchlife`;

async function poll() {
  /** @type {{ body: ClutchOut }} */
  let answer;
  try {
    answer = await read(PATH);
  } catch (problem) {
    if (!(problem instanceof Problem && problem.status === 404)) throw problem;
    showUnregistered();
    return;
  }
  due ||= answer.body !== latest; // until all of it is read: an error midway is made good at the next poll
  latest = answer.body;
  byId("inspections").hidden = false;
  if (due) {
    await refresh(answer.body);
    due = false;
  } else if (parts !== null) {
    await parts.diagnosis.poll();
    drawHead();
  }
  await inspections.poll(shown?.events ?? NO_EVENTS);
}

/**
 * @param {ClutchOut} clutch
 * @returns {Answers}
 */
const nothingOf = (clutch) => ({
  clutch,
  life: null,
  items: [],
  predictions: [],
  tests: [],
  loops: [],
  runs: [],
  events: [],
});

/** @param {ClutchOut} clutch */
async function refresh(clutch) {
  store.showArchived(clutch);
  if (shown === null || clutch.runs === 0) {
    shown = nothingOf(clutch);
    drawHead();
  }
  if (clutch.runs === 0) {
    await showUncounted();
    return;
  }
  // what the first chart needs and what waits for someone come first, neither after the other
  const [{ board, diagnosis, warned, first }, stored] = await Promise.all([showLife(clutch), showStored()]);
  const { tests, loops } = await readTests();
  const runs = stored.filter(counts);
  const events = runs.filter((run) => run.kind === "maintenance");
  shown = { clutch, ...first, tests, loops, runs, events };
  store.showWarnings({ runs: stored, tests, warned });
  if (events.length > 0) board.life({ ...shown, ...first });
  parts?.remaining.show(shown);
  await board.rest(shown);
  makeReport(byId("report"), shown, board, diagnosis.latest);
}

/** @param {ClutchOut} clutch */
async function showLife(clutch) {
  const { warned, ...first } = await readLife();
  const { board, diagnosis } = begin();
  const now = { ...(shown ?? nothingOf(clutch)), clutch, ...first };
  shown = now;
  drawHead();
  diagnosis.setModel(first.life.model);
  byId("criteria").replaceChildren(...criteriaTable(first.life));
  board.life(now);
  await diagnosis.poll();
  drawHead();
  return { board, diagnosis, warned, first };
}

/** The runs, whether they count or not. */
async function showStored() {
  /** @type {{ items: Receipt[] }} */
  const { items } = await readAll(`${PATH}/runs?limit=1000`);
  if (items.length > 0) byId("runs").hidden = false;
  await store.show(items);
  return items;
}

/** A clutch without a run that counts: what to do first, and the runs that are held or withdrawn. */
async function showUncounted() {
  showSections([]);
  store.showWarnings({ runs: [], tests: [], warned: [] });
  await showStored();
  if (!document.getElementById("first")) byId("archived").before(h("div", { id: "first" }, firstRun(ID)));
}

/** @param {string[]} names */
function showSections(names) {
  for (const section of SECTIONS) byId(section).hidden = !names.includes(section);
  byId("sections").hidden = names.length < SECTIONS.length;
}

/** Remaining life, degradation and the earlier predictions. */
async function readLife() {
  /** @type {[{ body: RemainingLife }, { body: { items: DegradationItem[], warnings: Warned[] } }, { items: SeriesItem[] }, { items: SeriesItem[] }]} */
  const [life, degradation, remaining, cof] = await Promise.all([
    read(`${PATH}/remaining-useful-life`),
    read(`${PATH}/degradation`),
    readAll(`${PATH}/series?quantity=remaining_cycles`),
    readAll(`${PATH}/series?quantity=mean_cof`),
  ]);
  const pooled = cof.items.filter((row) => row.pressure_bar === null && row.run_id === null);
  const cofAt = new Map(pooled.map((row) => [row.cycles, row.value]));
  const predictions = remaining.items.map((row) => {
    return { at: row.cycles, cof: cofAt.get(row.cycles) ?? null, remaining: row };
  });
  const warned = [...life.body.warnings, ...degradation.body.warnings];
  return { life: life.body, items: degradation.body.items, predictions, warned };
}

async function readTests() {
  /** @type {[{ items: StribeckItem[] }, { items: LoopItem[] }]} */
  const [tests, loops] = await Promise.all([readAll(`${PATH}/stribeck?limit=1000`), readAll(`${PATH}/loops`)]);
  return { tests: tests.items, loops: loops.items };
}

/** The page's parts, made when there is first something to put into them. */
function begin() {
  document.getElementById("first")?.remove();
  showSections(SECTIONS);
  if (parts !== null) return parts;
  const board = new Board(ID, fileName, (section) => within(section, ".charts"));
  const diagnosis = new Diagnosis(within("diagnosis", ".body"), ID, fileName, () => live.now());
  const remaining = new RemainingBy(within("life", ".by-quantity"), ID);
  new PlannedDuty(within("life", ".planning"), ID);
  parts = { board, diagnosis, remaining };
  return parts;
}

/** The head, drawn again where something in it is another than before. */
function drawHead() {
  if (shown === null) return;
  const { clutch, life } = shown;
  const text = JSON.stringify([clutch, life]);
  const place = byId("head");
  if (place.dataset.shown === text) return;
  place.dataset.shown = text;
  place.replaceChildren(
    ...head(clutch, life, {
      archive: () => store.archive(true),
      end: () => store.end(life?.ended ?? null, life?.as_of_cycles ?? 0),
    }),
  );
}

function showUnregistered() {
  const text = `No clutch is registered as “${ID}”. It appears here as soon as it is. `;
  const link = h("a", { href: "/" }, "All clutches");
  const notice = h("div", { class: "notice bad" }, h("h1", {}, "No such clutch"), h("p", {}, text, link));
  byId("head").replaceChildren(notice);
  delete byId("head").dataset.shown;
}

byId("print").addEventListener("click", () => {
  if (shown && parts) makeReport(byId("report"), shown, parts.board, parts.diagnosis.latest);
  print();
});
const store = new Stored(ID, () => live.now());
const inspections = new Inspections(within("inspections", ".body"), ID, fileName, store.change);
const live = new Live(withKey(poll), liveBar(byId("live")), INTERVAL);
sender(byId("send"), { clutch: ID, sent: () => live.now() });
live.start();
