// Planned duty: a form of blocks and a pace, and the remaining life under them. Nothing of it is stored.

import { send } from "../shared/api.js";
import { button, field, form, h, quiet, scrolling, table } from "../shared/dom.js";
import { fixed, sentence, significant } from "../shared/format.js";
import { attempted, numbersOf } from "../shared/problem_view.js";

/** @type {[name: string, label: string, value?: string][]} what is typed of a block; left empty it is not sent */
const OF_BLOCK = [
  ["energy_per_cycle_kj", "Energy per cycle, kJ"],
  ["cycles", "Duty cycles", "1000"],
  ["sd", "Standard deviation of this energy, kJ"],
];
/** What is shown of the answer's quantiles. */
const SHOWN = ["0.05", "0.5", "0.95"];

/** @type {(name: string, label: string, value?: string) => HTMLElement} a number of the form */
const entry = (name, label, value = "") => field(h("input", { name, value, inputmode: "decimal" }), label);

/** @type {(place: HTMLElement, clutch: ClutchPath) => void} */
export function plannedDuty(place, clutch) {
  /** @type {string | undefined} what a planned cycle counts by; undefined: as the service assumes */
  let countedBy;
  /** @type {{ element: HTMLElement, legend: HTMLElement, remove: HTMLElement }[]} */
  let blocks = [];
  const pace = entry("pace_cycles_per_hour", "Pace, duty cycles per hour (idle hours included)");
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

  /** Of a block its number, and the names of its fields as the service's errors have them. */
  function renumber() {
    for (const [place, { element, legend, remove }] of blocks.entries()) {
      legend.textContent = `Block ${place + 1}`;
      remove.setAttribute("aria-label", `Remove block ${place + 1}`);
      remove.hidden = blocks.length === 1;
      for (const [index, input] of inputsOf(element).entries()) input.name = `programme/${place}/${OF_BLOCK[index][0]}`;
    }
  }

  const ask = () => attempted([go], answer, "Computing …", predict, "No prediction. ");

  async function predict() {
    const inputs = inputsOf(plan);
    /** @type {Record<string, number>[]} */
    const programme = blocks.map(() => ({}));
    /** @type {Record<string, any>} */
    const planned = { programme, counted_by: countedBy };
    for (const [index, number] of numbersOf(inputs).entries()) {
      const [name, place, part] = inputs[index].name.split("/");
      if (number !== null) Object.assign(part ? programme[Number(place)] : planned, { [part ?? name]: number });
    }
    const { body } = await send("POST", `${clutch}/remaining-useful-life/forecast`, planned);
    answer.replaceChildren(...shown(body), other(body));
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

/** @param {PlannedLife} life */
function shown(life) {
  if (life.status === "insufficient_data") return [h("p.notice", sentence(life.statement))];
  /** @type {(quantiles: Quantiles, decimals: number) => string[]} */
  const numbers = (quantiles, decimals) =>
    SHOWN.map((quantile) => {
      const value = quantiles[quantile] ?? null;
      return value === null ? "over 1,000,000" : fixed(value, decimals);
    });
  const rows = [
    ["Remaining cycles", ...numbers(life.remaining_cycles, 0)],
    ["Remaining blocks", ...numbers(life.remaining_blocks, 1)],
    ["Cycles under recent duty", ...numbers(life.recent_duty_cycles, 0)],
  ];
  const { end_of_life_at: dates, counted_from: from } = life;
  if (dates !== null && from !== null)
    rows.push([
      `End of life, counted from the last run on ${from.slice(0, 10)}`,
      ...SHOWN.map((quantile) => dates[quantile]?.slice(0, 10) ?? "–"),
    ]);
  const columns = ["Probability", ...SHOWN.map((quantile) => `${significant(100 * Number(quantile))} %`)];
  return [
    scrolling("Planned duty", table("Remaining life under planned duty, by probability", columns, rows)),
    ...life.warnings.map(({ message }) => quiet(message)),
  ];
}
