// The page of all clutches: of the list of the API the part in sight goes in, and how many clutches there are; rows, worst
// first, come out. Searching, filtering and sorting are the service's.
// Open this file first (what is asked for and shown), then rows.js (which rows are drawn) and row.js (one of them).

import { pollRaised, showRaised } from "../alarms/raised.js";
import { sender } from "../sending/taking.js";
import { clutchPath, read, send } from "../shared/api.js";
import { agreed } from "../shared/dialog.js";
import { button, byId, h, markShown, showTab } from "../shared/dom.js";
import { age, counted } from "../shared/format.js";
import { Live } from "../shared/live.js";
import { problemView } from "../shared/problem_view.js";
import { stateIcon, STATES } from "../shared/state.js";
import { welcome } from "../shared/welcome.js";
import { Rows } from "./rows.js";

/** @import { StateName } from "../shared/state.js" */
/** @import { Part } from "./rows.js" */

const INTERVAL = 3000; // ms
/** From the last key that is typed until it is searched, ms. */
const PAUSE = 200;
const MAIN = byId("fleet");
const FIND = /** @type {HTMLInputElement} */ (byId("find"));
const ARCHIVED = /** @type {HTMLInputElement} */ (byId("archived"));
/** @type {Choice} */
let only = null;
/** @type {FleetTotals | null} */
let totals = null;
/** The address of the list that is shown, "" where it must be shown again. */
let shown = "";
const SORT = /** @type {HTMLSelectElement} */ (byId("sort"));
const rows = new Rows(
  () => live.now(),
  () => drawPicked(),
);

/** @type {Promise<() => Promise<void>> | null} the alarms' tab, which is loaded when it is opened */
let alarmsTab = null;
async function showAlarms() {
  alarmsTab ??= import("../alarms/alarms.js").then(({ alarms }) => alarms(byId("tab-alarms"), null));
  await (
    await alarmsTab
  )();
}

/** What totals and the list are asked for: archived or not, and what is searched for. */
function wanted() {
  const question = new URLSearchParams();
  if (ARCHIVED.checked) question.set("archived", "true");
  const find = FIND.value.trim();
  if (find) question.set("find", find);
  return question;
}

/** The same with the state that is chosen. */
function chosen() {
  const question = wanted();
  if (only === "held") question.set("held", "true");
  else if (only !== null) question.set("state", only);
  return question.toString();
}

/** The tab of the address in sight: the clutches, or the alarms of all of them. */
function turn() {
  const name = location.hash === "#/alarms" ? "alarms" : "clutches";
  showTab(["clutches", "alarms"], name);
  return name;
}

async function poll() {
  if (turn() === "alarms") {
    await Promise.all([showAlarms(), pollRaised()]);
    return;
  }
  const question = chosen();
  const part = rows.wanted();
  const list = /** @type {const} */ (
    `/v1/clutches?${question}${question && "&"}sort=${SORT.value}&offset=${part.offset}&limit=${part.limit}`
  );
  const before = shown;
  shown = ""; // until both are read: an error midway is made good at the next poll
  const [counted, page] = await Promise.all([read(`/v1/fleet/totals?${wanted()}`), read(list)]);
  if (question !== chosen()) return; // what was chosen meanwhile is asked for next
  if (counted.changed || page.changed || before !== list) show(counted.body, page.body.items, part);
  shown = list;
}

/** @type {(counted: FleetTotals, items: ClutchOut[], part: Part) => void} `part`: of the list that they are */
function show(counted, items, part) {
  totals = counted;
  showRaised(counted.alarms);
  document.getElementById("nothing")?.remove();
  if (counted.all === 0 && !wanted().has("find")) {
    byId("chips").replaceChildren();
    MAIN.replaceChildren(ARCHIVED.checked ? h("p.notice", "No clutch is archived.") : welcome());
    return;
  }
  if (!rows.element.isConnected) MAIN.replaceChildren(rows.element);
  const total = countOf(counted, only);
  rows.show(items, part, total, counted.scale_cycles);
  drawChips(counted);
  if (total === 0)
    MAIN.append(h("p", { id: "nothing", class: "notice", role: "status" }, "No clutch matches the search."));
  byId("printed").textContent =
    items.length < total ? `Rows ${part.offset + 1} to ${part.offset + items.length} of ${total}` : "";
  markShown("fleet-shown");
}

/** @param {Choice} choice */
function choose(choice) {
  only = choice;
  if (totals !== null) drawChips(totals);
  restart();
}

/** What can be done to the clutches that are chosen. */
function drawPicked() {
  const ids = [...rows.chosen];
  const query = ids.map((id) => `clutch=${encodeURIComponent(id)}`).join("&");
  const clear = () => {
    rows.chosen.clear();
    for (const box of rows.element.querySelectorAll("input")) box.checked = false;
    drawPicked();
  };
  byId("picked").hidden = ids.length === 0;
  byId("picked").replaceChildren(
    h("b", `${ids.length} chosen`),
    h("a", { href: `/compare?${query}`, class: "button" }, "Compare"),
    button(ARCHIVED.checked ? "Bring back …" : "Archive …", () => archive(ids)),
    button("Choose none", clear),
  );
}

/** @param {string[]} ids */
async function archive(ids) {
  const archived = !ARCHIVED.checked;
  const count = counted(ids.length, "clutch", "clutches");
  const sure = await agreed({
    title: archived ? `Archive ${count}?` : `Bring ${count} back?`,
    points: [
      archived
        ? "They disappear from the list and accept no new runs. Nothing is deleted: you can bring them back."
        : "They appear in the list again and accept new runs.",
      ids.join(", "),
    ],
    action: archived ? "Archive" : "Bring back",
  });
  if (!sure) return;
  try {
    for (const id of ids) {
      await send("PATCH", clutchPath(id), { archived, reason: "" });
      rows.chosen.delete(id);
    }
  } catch (problem) {
    byId("picked").after(problemView(problem, "Some of the clutches were not changed. "));
  }
  drawPicked();
  await live.now();
}

/** Another list is wanted: from its beginning, at once. */
function restart() {
  rows.grouped = SORT.value === "kind";
  rows.restart();
  live.now();
}

function updateAges() {
  for (const element of document.querySelectorAll("time[data-age]")) {
    const text = age(Number(element.getAttribute("data-age")));
    if (element.textContent !== text) element.textContent = text;
  }
}

/** @type {ReturnType<typeof setTimeout> | undefined} */
let typing;
FIND.addEventListener("input", () => {
  clearTimeout(typing);
  typing = setTimeout(restart, PAUSE);
});
SORT.addEventListener("change", restart);
ARCHIVED.addEventListener("change", () => {
  only = null;
  rows.chosen.clear();
  drawPicked();
  restart();
});
addEventListener("hashchange", () => live.now());
setInterval(updateAges, 15_000);
const live = new Live(poll, INTERVAL);
sender(byId("send"), { sent: () => live.now() });
byId("register").addEventListener("click", async () => {
  await (await import("../sending/registration.js")).registerAndOpen();
});
live.now();

/** @typedef {StateName | "held" | null} Choice a state, clutches with runs that are held, or all */

/** @type {(totals: FleetTotals, only: Choice) => number} how many clutches a choice shows */
function countOf({ all, held, states }, only) {
  return only === null ? all : only === "held" ? held : states[only];
}

/** @param {FleetTotals} totals */
function drawChips(totals) {
  /** @type {(name: Choice, label: string) => HTMLElement | null} */
  const chip = (name, label) => {
    const count = countOf(totals, name);
    if (count === 0 && name !== null && name !== only) return null;
    const pressed = String(only === name);
    const attributes = { class: "chip", "data-state": name ?? "all", "aria-pressed": pressed };
    const icon = name && name !== "held" && stateIcon(name);
    return button([icon, h("b", String(count)), ` ${label}`], () => choose(name), attributes);
  };
  const focused = document.activeElement instanceof HTMLElement ? document.activeElement.dataset.state : undefined;
  const names = /** @type {StateName[]} */ (Object.keys(STATES));
  const chips = [
    chip(null, totals.all === 1 ? "clutch" : "clutches"),
    ...names.map((name) => chip(name, STATES[name].toLowerCase())),
    chip("held", "with held runs"),
  ];
  byId("chips").replaceChildren(...chips.filter((element) => element !== null));
  chips.find((element) => focused && element?.dataset.state === focused)?.focus();
}
