// @ts-check
// The page of all clutches: the list of the API goes in; rows, worst first, with search and filters come out.
// Open this file first (reading, drawing in slices, filtering),
// then row.js (one clutch's row).

import { register } from "../sending/registration.js";
import { sender } from "../sending/sending.js";
import { readAll } from "../shared/api.js";
import { byId, h } from "../shared/dom.js";
import { age } from "../shared/format.js";
import { withKey } from "../shared/key.js";
import { Live } from "../shared/live.js";
import { liveBar } from "../shared/live_bar.js";
import { heldText, openVerdict, stateIcon, stateOf, STATES } from "../shared/state.js";
import { welcome } from "../shared/welcome.js";
import { COLUMNS, row } from "./row.js";

/** @import { State, StateName } from "../shared/state.js" */
/** @import { ClutchOut } from "../shared/types.js" */

/**
 * @typedef {object} Entry a clutch in the table
 * @property {string} text all that its row shows; the same text keeps the row
 * @property {ClutchOut} clutch
 * @property {number} scale
 * @property {State} state
 * @property {string} search what the search field looks into
 * @property {HTMLElement | null} element its row, once it is drawn
 * @property {boolean} fresh whether it changed since it was drawn
 */

const INTERVAL = 3000; // ms
const MAIN = byId("fleet");
const FIND = /** @type {HTMLInputElement} */ (byId("find"));
/** @type {Map<string, Entry>} */
const entries = new Map();
/** @type {HTMLElement | null} */
let body = null;
/** @typedef {StateName | "held" | null} Choice a state, clutches with runs that are held, or all */
/** @type {Choice} */
let only = null;
const ARCHIVED = /** @type {HTMLInputElement} */ (byId("archived"));
let due = true;

async function poll() {
  const before = due;
  const archived = ARCHIVED.checked;
  due = true; // until all pages are read: an error midway is made good at the next poll
  /** @type {{ items: ClutchOut[], changed: boolean }} */
  const { items, changed } = await readAll(`/v1/clutches?limit=1000${archived ? "&archived=true" : ""}`);
  if (archived !== ARCHIVED.checked) return; // switched meanwhile: the next poll shows the other list
  if (changed || before) show(items);
  due = false;
}

/** Rows drawn at once, which fill a screen, and in each slice after it: between them the page answers. */
const FIRST = 60;
const SLICE = 120;
let drawing = 0;

/** @param {ClutchOut[]} items */
function show(items) {
  drawing += 1;
  if (items.length === 0) {
    body = null;
    entries.clear();
    byId("chips").replaceChildren();
    MAIN.replaceChildren(ARCHIVED.checked ? h("p", { class: "notice" }, "No clutch is archived.") : welcome());
    return;
  }
  const place = body ?? makeTable();
  const scale = scaleOf(items);
  const present = new Set(items.map((clutch) => clutch.clutch_id));
  for (const id of entries.keys()) if (!present.has(id)) entries.delete(id);
  const order = items.map((clutch) => entryOf(clutch, scale));
  place.replaceChildren(
    ...order.slice(0, FIRST).map(drawn),
    ...order.slice(FIRST).flatMap(({ element }) => element ?? []),
  );
  drawChips();
  filter();
  const number = drawing;
  requestAnimationFrame(() =>
    setTimeout(() => {
      performance.mark("fleet-shown");
      drawRest(place, order, FIRST, number);
    }),
  );
}

/**
 * Draw what is not drawn yet, slice by slice, unless newer data came meanwhile.
 * @param {HTMLElement} place
 * @param {Entry[]} order
 * @param {number} from
 * @param {number} number of the drawing that this is part of
 */
function drawRest(place, order, from, number) {
  if (number !== drawing) return;
  if (from >= order.length) {
    performance.mark("fleet-complete");
    return;
  }
  const slice = order.slice(from, from + SLICE);
  if (slice.some(({ element }) => !element)) {
    place.append(...slice.map(drawn));
    for (const { element } of order.slice(from + SLICE)) if (element) place.append(element);
    filter();
  }
  setTimeout(() => drawRest(place, order, from + SLICE, number));
}

/**
 * A clutch that did not change keeps its row: nothing flickers, and a focused link keeps its focus.
 * @param {ClutchOut} clutch
 * @param {number} scale
 */
function entryOf(clutch, scale) {
  const text = `${scale} ${JSON.stringify(clutch)}`;
  const before = entries.get(clutch.clutch_id);
  if (before?.text === text) return before;
  const state = stateOf(clutch.summary, openVerdict(clutch.diagnosis));
  const waiting = clutch.held > 0 ? heldText(clutch.held) : "";
  const search = [
    clutch.clutch_id,
    clutch.friction_material,
    clutch.fluid,
    STATES[state.name].word,
    state.why,
    waiting,
  ];
  /** @type {Entry} */
  const entry = {
    text,
    clutch,
    scale,
    state,
    search: search.join(" ").toLowerCase(),
    element: null,
    fresh: before !== undefined,
  };
  entries.set(clutch.clutch_id, entry);
  return entry;
}

/** @param {Entry} entry */
function drawn(entry) {
  entry.element ??= row(entry.clutch, entry.state, entry.scale);
  if (entry.fresh) entry.element.classList.add("fresh");
  entry.fresh = false;
  return entry.element;
}

/**
 * The bars' right end: a round number that nine in ten of the intervals fit into.
 * @param {ClutchOut[]} items
 */
function scaleOf(items) {
  const ends = items
    .flatMap(({ summary }) => {
      if (summary?.status !== "predicted") return [];
      return summary.remaining_cycles["0.95"] ?? summary.remaining_cycles["0.5"] ?? [];
    })
    .filter((end) => end > 0);
  if (ends.length === 0) return 10_000;
  const end = ends.sort((a, b) => a - b)[Math.floor(0.9 * (ends.length - 1))];
  const unit = 10 ** Math.floor(Math.log10(end));
  return unit * ([1, 2, 5].find((step) => step * unit >= end) ?? 10);
}

/** The table without rows; returns the place of its rows. */
function makeTable() {
  const columns = COLUMNS.map((name) => h("th", { role: "columnheader", scope: "col" }, name));
  const place = h("tbody", { role: "rowgroup" });
  const table = h(
    "table",
    { class: "fleet", role: "table" },
    h("caption", { class: "hidden" }, "Clutches, the fewest remaining cycles first"),
    h("thead", { role: "rowgroup" }, h("tr", { role: "row" }, columns)),
    place,
  );
  MAIN.replaceChildren(table);
  body = place;
  return place;
}

/** @param {string | undefined} name of a state */
const chipOf = (name) => byId("chips").querySelector(`[data-state="${name}"]`);

function drawChips() {
  /** @type {(name: Choice, label: string, count: number) => HTMLElement} */
  const chip = (name, label, count) => {
    const choose = () => {
      only = name;
      drawChips();
      filter();
      focus(chipOf(name ?? "all"));
    };
    const pressed = String(only === name);
    const attributes = { type: "button", class: "chip", "data-state": name ?? "all", "aria-pressed": pressed };
    const icon = name && name !== "held" && stateIcon(name);
    return h("button", { ...attributes, onclick: choose }, icon, h("b", {}, String(count)), ` ${label}`);
  };
  const focused = document.activeElement instanceof HTMLElement ? document.activeElement.dataset.state : undefined;
  const names = /** @type {StateName[]} */ (Object.keys(STATES));
  const states = names.flatMap((name) => {
    const count = [...entries.values()].filter(({ state }) => state.name === name).length;
    return count > 0 ? [chip(name, STATES[name].word.toLowerCase(), count)] : [];
  });
  const held = [...entries.values()].filter(({ clutch }) => clutch.held > 0).length;
  const all = chip(null, entries.size === 1 ? "clutch" : "clutches", entries.size);
  byId("chips").replaceChildren(all, ...states, held > 0 ? chip("held", "with held runs", held) : "");
  if (focused) focus(chipOf(focused));
}

/** @param {Element | null} element */
function focus(element) {
  if (element instanceof HTMLElement) element.focus();
}

function filter() {
  const wanted = FIND.value.trim().toLowerCase();
  let shown = 0;
  for (const { element, clutch, state, search } of entries.values()) {
    const chosen = only === null || (only === "held" ? clutch.held > 0 : state.name === only);
    const hidden = !chosen || !search.includes(wanted);
    if (element) element.hidden = hidden;
    shown += hidden ? 0 : 1;
  }
  document.getElementById("nothing")?.remove();
  if (shown > 0 || entries.size === 0) return;
  MAIN.append(h("p", { id: "nothing", class: "notice", role: "status" }, "No clutch matches the search."));
}

function updateAges() {
  for (const element of document.querySelectorAll("time[data-age]")) {
    const text = age(Number(element.getAttribute("data-age")));
    if (element.textContent !== text) element.textContent = text;
  }
}

FIND.addEventListener("input", filter);
ARCHIVED.addEventListener("change", () => {
  due = true;
  only = null;
  entries.clear();
  live.now();
});
setInterval(updateAges, 15_000);
const live = new Live(withKey(poll), liveBar(byId("live")), INTERVAL);
sender(byId("send"), { clutches: () => (ARCHIVED.checked ? [] : [...entries.keys()]), sent: () => live.now() });
byId("register").addEventListener("click", async () => {
  const id = await register("");
  if (id !== null) location.assign(`/clutches/${encodeURIComponent(id)}`);
});
live.start();
