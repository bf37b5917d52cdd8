// One clutch: what is known is read again when it changes, and drawn where it is looked at.

import { clutchPath, read, readAll } from "./api.js";
import { board } from "./board.js";
import { head } from "./clutchhead.js";
import { Diagnosis } from "./diagnosis.js";
import { byId, h } from "./dom.js";
import { withKey } from "./key.js";
import { Live } from "./live.js";
import { liveBar } from "./livebar.js";
import { makeReport } from "./report.js";
import { showRuns } from "./runs.js";
import { sender } from "./sending.js";
import { openVerdict, stateOf } from "./state.js";
import { firstRun } from "./welcome.js";

const ID = decodeURIComponent(location.pathname.split("/").at(-1));
const PATH = clutchPath(ID);
const SECTIONS = ["life", "diagnosis", "stribeck", "parameters", "loops", "runs"];
const name = () => ID.replaceAll(/[^\w.-]+/g, "_");

let shown = null;
let due = true;
let charts = null;
let diagnosis = null;
document.title = `${ID} · Clutchlife`;

async function look() {
  let found;
  try {
    found = await read(PATH);
  } catch (problem) {
    if (problem.status !== 404) throw problem;
    unknown();
    return;
  }
  due ||= found.changed; // until all of it is read: an error midway is made good at the next look
  if (due) { await refresh(found.body); due = false; } else if (diagnosis) { await diagnosis.look(); standing(); }
}

async function refresh(clutch) {
  const data = { clutch, life: null, items: [], foretold: [], tests: [], loops: [], runs: [], events: [] };
  if (clutch.runs === 0) { shown = data; empty(); return; }
  if (shown === null) { shown = data; standing(); }
  // what the first chart needs comes first
  const [life, degradation, remaining, cof] = await Promise.all([
    read(`${PATH}/remaining-useful-life`), readAll(`${PATH}/degradation`), readAll(`${PATH}/series?quantity=remaining_cycles`), readAll(`${PATH}/series?quantity=mean_cof`)]);
  const known = new Map(cof.items.filter((row) => row.pressure_bar === null && row.run_id === null).map((row) => [row.cycles, row.value]));
  Object.assign(data, { life: life.body, items: degradation.items, foretold: remaining.items.map((row) => ({ at: row.cycles, cof: known.get(row.cycles) ?? null, remaining: row })) });
  begin();
  shown = { ...(shown ?? data), ...data, tests: shown?.tests ?? [], loops: shown?.loops ?? [], runs: shown?.runs ?? [], events: shown?.events ?? [] };
  standing();
  diagnosis.setModel(data.life.model);
  charts.life(shown);
  await diagnosis.look();
  standing();
  const [tests, loops, runs] = await Promise.all([readAll(`${PATH}/stribeck?limit=1000`), readAll(`${PATH}/loops`), readAll(`${PATH}/runs?limit=1000`)]);
  shown = { ...data, tests: tests.items, loops: loops.items, runs: runs.items, events: runs.items.filter((run) => run.kind === "maintenance") };
  showRuns(byId("runs").querySelector(".body"), shown.runs, ID);
  if (shown.events.length > 0) charts.life(shown);
  await charts.rest(shown);
  makeReport(byId("report"), shown, charts, diagnosis);
}

/** The page's parts, made when there is first something to put into them. */
function begin() {
  if (charts !== null) return;
  byId("first")?.remove();
  for (const section of SECTIONS) byId(section).hidden = false;
  byId("sections").hidden = false;
  charts = board(ID, name, (section) => byId(section).querySelector(".charts"));
  diagnosis = new Diagnosis(byId("diagnosis").querySelector(".body"), ID, name, () => live.now());
}

function standing() {
  const state = stateOf(shown.clutch.summary, openVerdict(diagnosis?.latest));
  const text = JSON.stringify([shown.clutch, shown.life, state]);
  if (byId("head").dataset.shown === text) return;
  byId("head").dataset.shown = text;
  byId("head").replaceChildren(...head(shown.clutch, shown.life, state).filter(Boolean));
}

function empty() {
  standing();
  if (!byId("first")) byId("head").after(h("div", { id: "first" }, firstRun(ID)));
}

function unknown() {
  byId("head").replaceChildren(h("div", { class: "notice bad" }, h("h1", {}, "No such clutch"), h("p", {}, `The service knows no clutch as “${ID}”. It appears here as soon as it is registered. `, h("a", { href: "/" }, "All clutches"))));
  delete byId("head").dataset.shown;
}

byId("print").addEventListener("click", () => { if (shown) makeReport(byId("report"), shown, charts, diagnosis); print(); });
const live = new Live(withKey(look), liveBar(byId("live")), 2000);
sender(byId("send"), { clutches: () => [ID], sent: () => live.now() });
live.start();
