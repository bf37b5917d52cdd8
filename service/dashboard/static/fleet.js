// The fleet: every clutch, worst first, kept up to date.

import { readAll } from "./api.js";
import { byId, h } from "./dom.js";
import { COLUMNS, row, standing } from "./fleetrow.js";
import { age } from "./format.js";
import { withKey } from "./key.js";
import { Live } from "./live.js";
import { liveBar } from "./livebar.js";
import { sender } from "./sending.js";
import { stateIcon, STATES } from "./state.js";
import { welcome } from "./welcome.js";

const EVERY = 3000;
const MAIN = byId("fleet");
const known = new Map(); // clutch_id -> { text, element, standing }
let body = null;
let only = null;
let due = true;

async function look() {
  const before = due;
  due = true; // until all pages are read: an error midway is made good at the next look
  const { items, changed } = await readAll("/v1/clutches?limit=1000");
  if (changed || before) show(items);
  due = false;
}

/** Rows drawn at once, which fill a screen, and in each slice after it: between them the page answers. */
const FIRST = 60;
const SLICE = 120;
let drawing = 0;

function show(items) {
  drawing += 1;
  if (items.length === 0) { body = null; known.clear(); byId("chips").replaceChildren(); MAIN.replaceChildren(welcome()); return; }
  if (body === null) MAIN.replaceChildren(frame());
  const scale = scaleOf(items);
  const order = new Set(items.map((clutch) => clutch.clutch_id));
  for (const id of known.keys()) if (!order.has(id)) known.delete(id);
  const entries = items.map((clutch) => entry(clutch, scale));
  body.replaceChildren(...entries.slice(0, FIRST).map(drawn), ...entries.slice(FIRST).flatMap(({ element }) => element ?? []));
  chips();
  filter();
  requestAnimationFrame(() => setTimeout(() => { performance.mark("fleet-shown"); rest(entries, FIRST, drawing); }));
}

/** Draw what is not drawn yet, slice by slice, unless newer data came meanwhile. */
function rest(entries, from, number) {
  if (number !== drawing) return;
  if (from >= entries.length) { performance.mark("fleet-complete"); return; }
  const slice = entries.slice(from, from + SLICE);
  if (slice.some(({ element }) => !element)) {
    body.append(...slice.map(drawn));
    for (const later of entries.slice(from + SLICE)) if (later.element) body.append(later.element);
    filter();
  }
  setTimeout(() => rest(entries, from + SLICE, number));
}

/** A clutch that did not change keeps its row: nothing flickers, and a focused link keeps its focus. */
function entry(clutch, scale) {
  const text = `${scale} ${JSON.stringify(clutch)}`;
  const before = known.get(clutch.clutch_id);
  if (before?.text === text) return before;
  const { state } = standing(clutch);
  const { word } = STATES[state.name];
  const search = [clutch.clutch_id, clutch.friction_material, clutch.fluid, word, state.why].join(" ").toLowerCase();
  const made = { text, clutch, scale, stands: state, word, state: state.name, search, element: null, fresh: before !== undefined };
  known.set(clutch.clutch_id, made);
  return made;
}

function drawn(made) {
  made.element ??= row({ clutch: made.clutch, state: made.stands, word: made.word }, made.scale);
  if (made.fresh) made.element.classList.add("fresh");
  made.fresh = false;
  return made.element;
}

/** The bars' right end: a round number that nine in ten of the intervals fit into. */
function scaleOf(items) {
  const ends = items.flatMap(({ summary }) => (summary?.status === "predicted" ? [summary.remaining_cycles["0.95"] ?? summary.remaining_cycles["0.5"]] : [])).filter((end) => end > 0);
  if (ends.length === 0) return 10_000;
  const end = ends.sort((a, b) => a - b)[Math.floor(0.9 * (ends.length - 1))];
  const unit = 10 ** Math.floor(Math.log10(end));
  return [1, 2, 5, 10].map((step) => step * unit).find((round) => round >= end);
}

function frame() {
  body = h("tbody", { role: "rowgroup" });
  return h("table", { class: "fleet", role: "table" },
    h("caption", { class: "hidden" }, "Clutches, the fewest remaining cycles first"),
    h("thead", { role: "rowgroup" }, h("tr", { role: "row" }, COLUMNS.map((name) => h("th", { role: "columnheader", scope: "col" }, name)))),
    body);
}

function chips() {
  const counts = {};
  for (const { state } of known.values()) counts[state] = (counts[state] ?? 0) + 1;
  const chip = (name, label, count, icon) => h("button", {
    type: "button", class: "chip", "data-state": name ?? "all", "aria-pressed": String(only === name),
    onclick: () => { only = name; chips(); filter(); byId("chips").querySelector(`[data-state="${name ?? "all"}"]`)?.focus(); },
  }, icon, h("b", {}, String(count)), ` ${label}`);
  const focused = document.activeElement?.dataset?.state;
  byId("chips").replaceChildren(chip(null, known.size === 1 ? "clutch" : "clutches", known.size, null),
    ...Object.entries(STATES).filter(([name]) => counts[name]).map(([name, { word }]) => chip(name, word.toLowerCase(), counts[name], stateIcon(name))));
  if (focused) byId("chips").querySelector(`[data-state="${focused}"]`)?.focus();
}

function filter() {
  const wanted = byId("find").value.trim().toLowerCase();
  let shown = 0;
  for (const { element, state, search } of known.values()) {
    const hidden = (only !== null && state !== only) || !search.includes(wanted);
    if (element) element.hidden = hidden;
    shown += hidden ? 0 : 1;
  }
  byId("nothing")?.remove();
  if (shown === 0 && known.size > 0) MAIN.append(h("p", { id: "nothing", class: "notice", role: "status" }, "No clutch fits what you look for."));
}

function ages() {
  for (const element of document.querySelectorAll("time[data-age]")) {
    const text = age(Number(element.dataset.age));
    if (element.textContent !== text) element.textContent = text;
  }
}

byId("find").addEventListener("input", filter);
setInterval(ages, 15_000);
const live = new Live(withKey(look), liveBar(byId("live")), EVERY);
sender(byId("send"), { clutches: () => [...known.keys()], sent: () => live.now() });
live.start();
