// @ts-check
// Planned duty: a form of blocks and a pace, and the remaining life under them. Nothing of it is stored.

import { clutchPath, Problem, sendJson } from "../shared/api.js";
import { button, field, h, quiet, scrolling, table } from "../shared/dom.js";
import { fixed, NOT_A_NUMBER, numberOf, significant, sentence } from "../shared/format.js";
import { problemView } from "../shared/problem_view.js";

/** @import { PlannedLife, ProblemError, Quantiles } from "../shared/types.js" */

/** @typedef {{ name: string, label: string, value?: string }} Entry a number of the form; left empty it is not sent */

/** @type {Entry[]} */
const OF_BLOCK = [
  { name: "energy_per_cycle_kj", label: "Energy per cycle, kJ" },
  { name: "cycles", label: "Duty cycles", value: "1000" },
  { name: "sd", label: "Standard deviation of this energy, kJ" },
];
/** @type {Entry} */
const PACE = { name: "pace_cycles_per_hour", label: "Pace, duty cycles per hour (idle hours included)" };
/** What is shown of the answer's quantiles. */
const SHOWN = ["0.05", "0.5", "0.95"];

export class PlannedDuty {
  /**
   * @param {HTMLElement} place
   * @param {string} clutchId
   */
  constructor(place, clutchId) {
    this.address = `${clutchPath(clutchId)}/remaining-useful-life/forecast`;
    /** @type {string | undefined} what a planned cycle counts by; undefined: as the service assumes */
    this.countedBy = undefined;
    this.blocks = h("div", { class: "blocks" });
    this.pace = h("div", { class: "fields" }, number(`/${PACE.name}`, PACE));
    this.answer = h("div", { class: "answer", "aria-live": "polite" });
    this.go = h("button", { class: "main" }, "Predict");
    const more = button("Add a block", () => this.add());
    const buttons = h("div", { class: "buttons" }, more, this.go);
    this.form = h("form", { novalidate: true, onsubmit: this.submit }, this.blocks, this.pace, buttons, this.answer);
    const about = "The blocks run one after the other and repeat until the end of life. Fields may stay empty.";
    place.append(h("details", { class: "planned" }, h("summary", {}, "Planned duty"), quiet(about), this.form));
    this.append();
  }

  /** A block at the end, with the focus in it. */
  add() {
    this.append();
    focus(this.blocks, "fieldset:last-child input");
  }

  append() {
    const block = h("fieldset", {});
    const remove = () => {
      block.remove();
      this.renumber();
      focus(this.blocks, "fieldset:last-child input");
    };
    block.append(
      h("legend", {}),
      h(
        "div",
        { class: "fields" },
        OF_BLOCK.map((entry) => number("", entry)),
      ),
      h("p", { class: "wrong", hidden: true }),
      button("Remove", remove, { class: "remove" }),
    );
    this.blocks.append(block);
    this.renumber();
  }

  /** Names, places of errors and buttons follow a block's number. */
  renumber() {
    const blocks = [...this.blocks.querySelectorAll("fieldset")];
    for (const [place, block] of blocks.entries()) {
      const title = `Block ${place + 1}`;
      const remove = block.querySelector("button");
      block.dataset.pointer = `/programme/${place}`;
      block.querySelector("legend")?.replaceChildren(title);
      remove?.setAttribute("aria-label", `Remove block ${place + 1}`);
      if (remove) remove.hidden = blocks.length === 1;
      for (const input of block.querySelectorAll("input")) {
        input.dataset.pointer = `/programme/${place}/${input.name}`;
        input.id = idOf(input.dataset.pointer);
        const label = input.parentElement?.querySelector("label");
        label?.setAttribute("for", input.id);
      }
    }
  }

  submit = async (/** @type {SubmitEvent} */ event) => {
    event.preventDefault();
    this.countedBy = undefined;
    await this.ask();
  };

  async ask() {
    this.clear();
    const unread = [...this.form.querySelectorAll("input")].filter((input) => numberOf(input.value) === undefined);
    for (const input of unread) this.mark({ pointer: input.dataset.pointer ?? "", message: NOT_A_NUMBER });
    if (unread.length > 0) {
      this.answer.replaceChildren();
      focus(this.form, "[aria-invalid]");
      return;
    }
    this.go.disabled = true;
    this.answer.replaceChildren(quiet("Computing …"));
    try {
      /** @type {{ body: PlannedLife }} */
      const { body } = await sendJson("POST", this.address, this.programme());
      this.answer.replaceChildren(...shown(body), this.other(body));
    } catch (problem) {
      if (!(problem instanceof Problem)) throw problem;
      const elsewhere = problem.errors.filter((error) => !this.mark(error));
      const all = problem.errors.length > 0 && elsewhere.length === 0;
      const marked = h("p", { class: "notice bad", role: "alert" }, "The plan is incomplete: see the marked fields.");
      this.answer.replaceChildren(all ? marked : problemView(problem, "No prediction. "));
      focus(this.form, "[aria-invalid]");
    } finally {
      this.go.disabled = false;
    }
  }

  /**
   * The other way to count, in one click, where the service assumed one.
   * @param {PlannedLife} life
   */
  other({ counted_by: by, warnings }) {
    const assumed = warnings.some(({ code }) => code === "counted_by_energy");
    if (!assumed && this.countedBy === undefined) return "";
    const [next, label] =
      by === "cycles" ? ["dissipated_energy", "Count by energy"] : ["cycles", "Count every cycle as one"];
    const ask = () => {
      this.countedBy = next;
      this.ask();
    };
    return button(label, ask);
  }

  programme() {
    const programme = [...this.blocks.querySelectorAll("fieldset")].map((block) => numbersIn(block));
    return { programme, ...numbersIn(this.pace), counted_by: this.countedBy };
  }

  clear() {
    for (const input of this.form.querySelectorAll("[aria-invalid]")) {
      input.removeAttribute("aria-invalid");
      input.removeAttribute("aria-describedby");
    }
    for (const note of this.form.querySelectorAll(".wrong")) {
      note.replaceChildren();
      note.toggleAttribute("hidden", true);
    }
  }

  /**
   * An error at the field or the block that it is about; whether there is one.
   * @param {Pick<ProblemError, "pointer" | "message">} error
   */
  mark({ pointer, message }) {
    const places = [...this.form.querySelectorAll("[data-pointer]")];
    const place = places.find((element) => element instanceof HTMLElement && element.dataset.pointer === pointer);
    if (place === undefined) return false;
    const note = place instanceof HTMLInputElement ? place.nextElementSibling : place.querySelector(":scope > .wrong");
    const input = place instanceof HTMLInputElement ? place : place.querySelector("input:last-of-type");
    if (note === null || input === null) return false;
    note.id = `${idOf(pointer)}-wrong`;
    note.replaceChildren(message.replace(/^programme\S*: /, "")); // the field says where it is
    note.toggleAttribute("hidden", false);
    input.setAttribute("aria-invalid", "true");
    input.setAttribute("aria-describedby", note.id);
    return true;
  }
}

/** @type {(place: HTMLElement, selector: string) => void} */
function focus(place, selector) {
  const element = place.querySelector(selector);
  if (element instanceof HTMLElement) element.focus();
}

/** @param {string} pointer */
const idOf = (pointer) => `planned${pointer.replaceAll("/", "-")}`;

/** @type {(pointer: string, entry: Entry) => HTMLElement} `pointer`: "" until the block has its number */
function number(pointer, { name, label, value = "" }) {
  const attributes = { inputmode: "decimal", autocomplete: "off" };
  const input = h("input", { id: idOf(pointer), name, value, "data-pointer": pointer, ...attributes });
  return field(input, label, h("p", { class: "wrong", hidden: true }));
}

/** @param {HTMLElement} place */
function numbersIn(place) {
  const filled = [...place.querySelectorAll("input")].filter((input) => input.value.trim() !== "");
  return Object.fromEntries(filled.map((input) => [input.name, numberOf(input.value)]));
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
  if (life.status === "insufficient_data") return [h("p", { class: "notice" }, sentence(life.statement))];
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
