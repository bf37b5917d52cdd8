// Planned duty: a form of blocks and a pace, and the remaining life under them. Nothing of it is stored.

import { clutchPath, Problem, send } from "../shared/api.js";
import { button, field, form, h, quiet, scrolling, table } from "../shared/dom.js";
import { fixed, NOT_A_NUMBER, numberOf, significant, sentence } from "../shared/format.js";
import { attempted } from "../shared/problem_view.js";

/** @type {[name: string, label: string, value?: string][]} what is typed of a block; left empty it is not sent */
const OF_BLOCK = [
  ["energy_per_cycle_kj", "Energy per cycle, kJ"],
  ["cycles", "Duty cycles", "1000"],
  ["sd", "Standard deviation of this energy, kJ"],
];
const PACE = "pace_cycles_per_hour";
/** What is shown of the answer's quantiles. */
const SHOWN = ["0.05", "0.5", "0.95"];

/** Numbers the fields: labels need names of their own. */
let count = 0;

/** @type {(name: string, label: string, value?: string) => HTMLElement} a number of the form, below it what is wrong with it */
function entry(name, label, value = "") {
  const id = `planned-${(count += 1)}`;
  const attributes = { inputmode: "decimal", "aria-describedby": `${id}-wrong` };
  return field(h("input", { id, name, value, ...attributes }), label, h("p.wrong", { id: `${id}-wrong` }));
}

/** @type {(place: HTMLElement, clutchId: string) => void} */
export function plannedDuty(place, clutchId) {
  const address = `${clutchPath(clutchId)}/remaining-useful-life/forecast`;
  /** @type {string | undefined} what a planned cycle counts by; undefined: as the service assumes */
  let countedBy;
  /** @type {{ element: HTMLElement, legend: HTMLElement, remove: HTMLElement }[]} */
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
  const submit = () => {
    countedBy = undefined;
    ask();
  };
  const plan = form(submit, all, h("div.fields", pace), buttons, answer);
  const about = "The blocks run one after the other and repeat until the end of life. Fields may stay empty.";
  place.append(h("details.planned", h("summary", "Planned duty"), quiet(about), plan));
  append();

  const focusLast = () => blocks.at(-1)?.element.querySelector("input")?.focus();

  function append() {
    const legend = h("legend");
    const entries = OF_BLOCK.map((each) => entry(...each));
    const remove = button("Remove", () => drop(element), { class: "remove" });
    const element = h("fieldset", legend, h("div.fields", entries), remove);
    all.append(element);
    blocks.push({ element, legend, remove });
    renumber();
  }

  /** @param {HTMLElement} block */
  function drop(block) {
    block.remove();
    blocks = blocks.filter(({ element }) => element !== block);
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

  /** @type {(pointer: string) => HTMLInputElement | undefined} the number that an error is about; of a whole block its first */
  function numberAt(pointer) {
    const [, part, place, name] = pointer.split("/");
    const within = part === PACE ? pace : blocks[Number(place)]?.element;
    return within && inputsOf(within).find((input) => name === undefined || input.name === name);
  }

  async function ask() {
    const inputs = inputsOf(plan);
    for (const input of inputs) mark(input, "");
    for (const input of inputs) if (numberOf(input.value) === undefined) mark(input, NOT_A_NUMBER);
    answer.replaceChildren();
    if (focusWrong()) return;
    await attempted([go], answer, "Computing …", predict, "No prediction. ");
    focusWrong();
  }

  async function predict() {
    const programme = blocks.map(({ element }) => numbersIn(element));
    try {
      /** @type {{ body: PlannedLife }} */
      const { body } = await send("POST", address, { programme, ...numbersIn(pace), counted_by: countedBy });
      answer.replaceChildren(...shown(body), other(body));
    } catch (problem) {
      const errors = problem instanceof Problem ? problem.errors : [];
      const elsewhere = errors.filter(({ pointer, message }) => !mark(numberAt(pointer), message));
      if (errors.length === 0 || elsewhere.length > 0) throw problem;
      answer.replaceChildren(h("p.notice.bad", { role: "alert" }, "The plan is incomplete: see the marked fields."));
    }
  }

  /** Whether a number is wrong: the first that is has the focus then. */
  function focusWrong() {
    const first = inputsOf(plan).find((input) => input.hasAttribute("aria-invalid"));
    first?.focus();
    return first !== undefined;
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

/** @param {HTMLElement} place */
const inputsOf = (place) => [...place.querySelectorAll("input")];

/** @type {(input: HTMLInputElement | undefined, message: string) => boolean} what is wrong with a number, "": nothing; whether it is known */
function mark(input, message) {
  if (!input?.nextElementSibling) return false;
  input.nextElementSibling.textContent = message.replace(/^programme\S*: /, ""); // the field says where it is
  if (message) input.setAttribute("aria-invalid", "true");
  else input.removeAttribute("aria-invalid");
  return true;
}

/** @param {HTMLElement} place */
function numbersIn(place) {
  const filled = inputsOf(place).filter(({ value }) => value.trim() !== "");
  return Object.fromEntries(filled.map(({ name, value }) => [name, numberOf(value)]));
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
