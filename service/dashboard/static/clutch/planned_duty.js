// Planned duty: a form of blocks and a pace, and the remaining life under them. Nothing of it is stored.

import { clutchPath, Problem, sendJson } from "../shared/api.js";
import { button, field, h, quiet, scrolling, table } from "../shared/dom.js";
import { fixed, NOT_A_NUMBER, numberOf, significant, sentence } from "../shared/format.js";
import { problemView } from "../shared/problem_view.js";

/** @type {[name: string, label: string, value?: string][]} what is typed of a block; left empty it is not sent */
const OF_BLOCK = [
  ["energy_per_cycle_kj", "Energy per cycle, kJ"],
  ["cycles", "Duty cycles", "1000"],
  ["sd", "Standard deviation of this energy, kJ"],
];
const PACE = "pace_cycles_per_hour";
/** What is shown of the answer's quantiles. */
const SHOWN = ["0.05", "0.5", "0.95"];

/** @typedef {{ input: HTMLInputElement, note: HTMLElement }} Entry what is typed, and below it what is wrong with it */
/** @typedef {Record<"element" | "legend" | "remove" | "note", HTMLElement> & { entries: Entry[] }} Block */

/** Numbers the fields: labels need names of their own. */
let count = 0;

/** @type {(name: string, label: string, value?: string) => Entry & { element: HTMLElement }} a number of the form */
function entry(name, label, value = "") {
  const id = `planned-${(count += 1)}`;
  const input = h("input", { id, name, value, inputmode: "decimal", autocomplete: "off" });
  const note = wrongNote();
  return { input, note, element: field(input, label, note) };
}

const wrongNote = () => h("p.wrong", { id: `planned-${(count += 1)}`, hidden: true });

/** @type {(place: HTMLElement, clutchId: string) => void} */
export function plannedDuty(place, clutchId) {
  const address = `${clutchPath(clutchId)}/remaining-useful-life/forecast`;
  /** @type {string | undefined} what a planned cycle counts by; undefined: as the service assumes */
  let countedBy;
  /** @type {Block[]} */
  let blocks = [];
  const pace = entry(PACE, "Pace, duty cycles per hour (idle hours included)");
  const all = h("div.blocks");
  const answer = h("div.answer", { "aria-live": "polite" });
  const go = h("button.main", "Predict");
  const add = () => {
    append();
    focusLast();
  };
  const buttons = h("div.row.buttons", button("Add a block", add), go);
  const onsubmit = (/** @type {SubmitEvent} */ event) => {
    event.preventDefault();
    countedBy = undefined;
    ask();
  };
  const form = h("form", { novalidate: true, onsubmit }, all, h("div.fields", pace.element), buttons, answer);
  const about = "The blocks run one after the other and repeat until the end of life. Fields may stay empty.";
  place.append(h("details.planned", h("summary", "Planned duty"), quiet(about), form));
  append();

  const focusLast = () => blocks.at(-1)?.entries[0].input.focus();

  function append() {
    const entries = OF_BLOCK.map((each) => entry(...each));
    const fields = h("div.fields", ...entries.map(({ element }) => element));
    const [legend, note] = [h("legend"), wrongNote()];
    const remove = button("Remove", () => drop(block), { class: "remove" });
    const block = { element: h("fieldset", legend, fields, note, remove), legend, remove, note, entries };
    all.append(block.element);
    blocks.push(block);
    renumber();
  }

  /** @param {Block} block */
  function drop(block) {
    block.element.remove();
    blocks = blocks.filter((other) => other !== block);
    renumber();
    focusLast();
  }

  function renumber() {
    for (const [place, { legend, remove }] of blocks.entries()) {
      legend.textContent = `Block ${place + 1}`;
      remove.setAttribute("aria-label", `Remove block ${place + 1}`);
      remove.hidden = blocks.length === 1;
    }
  }

  /** Every number by the place that an error of the service names; a block's own error is marked at its first number. */
  function places() {
    /** @type {[string, Entry][]} */
    const numbers = blocks.flatMap(({ entries, note }, place) => [
      [`/programme/${place}`, { input: entries[0].input, note }],
      ...entries.map((each) => /** @type {[string, Entry]} */ ([`/programme/${place}/${each.input.name}`, each])),
    ]);
    return new Map([...numbers, [`/${PACE}`, pace]]);
  }

  async function ask() {
    const known = places();
    for (const { input, note } of known.values()) {
      input.removeAttribute("aria-invalid");
      input.removeAttribute("aria-describedby");
      note.replaceChildren();
      note.hidden = true;
    }
    const numbers = [...blocks.flatMap(({ entries }) => entries), pace];
    const unread = numbers.filter(({ input }) => numberOf(input.value) === undefined);
    for (const each of unread) mark(each, NOT_A_NUMBER);
    if (unread.length > 0) {
      answer.replaceChildren();
      return focusWrong();
    }
    go.disabled = true;
    answer.replaceChildren(quiet("Computing …"));
    try {
      const programme = blocks.map(({ entries }) => numbersIn(entries));
      /** @type {{ body: PlannedLife }} */
      const { body } = await sendJson("POST", address, { programme, ...numbersIn([pace]), counted_by: countedBy });
      answer.replaceChildren(...shown(body), other(body));
    } catch (problem) {
      if (!(problem instanceof Problem)) throw problem;
      const elsewhere = problem.errors.filter(({ pointer, message }) => !mark(known.get(pointer), message));
      const marked = problem.errors.length > 0 && elsewhere.length === 0;
      const see = h("p.notice.bad", { role: "alert" }, "The plan is incomplete: see the marked fields.");
      answer.replaceChildren(marked ? see : problemView(problem, "No prediction. "));
      focusWrong();
    } finally {
      go.disabled = false;
    }
  }

  function focusWrong() {
    const first = form.querySelector("[aria-invalid]");
    if (first instanceof HTMLElement) first.focus();
  }

  /** @type {(life: PlannedLife) => HTMLElement | string} the other way to count, where the service assumed one */
  function other({ counted_by: by, warnings }) {
    const assumed = warnings.some(({ code }) => code === "counted_by_energy");
    if (!assumed && countedBy === undefined) return "";
    const [next, label] =
      by === "cycles" ? ["dissipated_energy", "Count by energy"] : ["cycles", "Count every cycle as one"];
    return button(label, () => {
      countedBy = next;
      ask();
    });
  }
}

/** @type {(entry: Entry | undefined, message: string) => boolean} an error at what it is about; whether that is known */
function mark(entry, message) {
  if (entry === undefined) return false;
  const { input, note } = entry;
  note.replaceChildren(message.replace(/^programme\S*: /, "")); // the field says where it is
  note.hidden = false;
  input.setAttribute("aria-invalid", "true");
  input.setAttribute("aria-describedby", note.id);
  return true;
}

/** @param {Entry[]} entries */
function numbersIn(entries) {
  const filled = entries.filter(({ input }) => input.value.trim() !== "");
  return Object.fromEntries(filled.map(({ input }) => [input.name, numberOf(input.value)]));
}

/** @param {PlannedLife} life */
function shown(life) {
  const {
    remaining_cycles: cycles,
    remaining_blocks: blocks,
    end_of_life_at: dates,
    recent_duty_cycles: recent,
  } = life;
  /** @type {(quantiles: Quantiles, decimals: number) => string[]} */
  const numbers = (quantiles, decimals) =>
    SHOWN.map((quantile) => {
      const value = quantiles[quantile] ?? null;
      return value === null ? "over 1,000,000" : fixed(value, decimals);
    });
  if (life.status === "insufficient_data") return [h("p.notice", sentence(life.statement))];
  const rows = [
    ["Remaining cycles", ...numbers(cycles, 0)],
    ["Remaining blocks", ...numbers(blocks, 1)],
    ["Cycles under recent duty", ...numbers(recent, 0)],
  ];
  if (dates !== null && life.counted_from !== null)
    rows.push([
      `End of life, counted from the last run on ${life.counted_from.slice(0, 10)}`,
      ...SHOWN.map((quantile) => dates[quantile]?.slice(0, 10) ?? "–"),
    ]);
  const columns = ["Probability", ...SHOWN.map((quantile) => `${significant(100 * Number(quantile))} %`)];
  const notes = life.warnings.map(({ message }) => quiet(message));
  return [
    scrolling("Planned duty", table("Remaining life under planned duty, by probability", columns, rows)),
    ...notes,
  ];
}
