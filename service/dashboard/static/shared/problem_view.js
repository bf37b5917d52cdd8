// A problem as the reader sees it, with every place that is wrong in what was sent.

import { Problem } from "./api.js";
import { h, quiet, scrolling, table } from "./dom.js";
import { NOT_A_NUMBER, numberOf } from "./format.js";

/**
 * The problem's sentence and its errors, row by row; anything else than a Problem is the page's own mistake and thrown on.
 * @param {unknown} problem
 * @param {string} [lead] what has not happened
 */
export function problemView(problem, lead) {
  if (!(problem instanceof Problem)) throw problem;
  const rows = problem.errors.map((error) => [
    error.row === null ? "" : String(error.row),
    error.pointer,
    error.value,
    error.message,
  ]);
  const columns = ["Row", "Place", "Value", "What is wrong"];
  const start = lead ?? (problem.status > 0 ? "Not stored. " : "Not sent. ");
  const title = problem.title ? `${problem.title}: ` : "";
  return h(
    "div",
    h("p.notice.bad", { role: "alert" }, h("b", start), title, problem.detail),
    rows.length > 0 && scrolling("What is wrong", table("What is wrong, by place", columns, rows)),
    problem.total > rows.length && quiet(`${rows.length} of ${problem.total} errors are shown.`),
  );
}

/** @type {(place: Element, problem: Problem) => boolean} say errors at the fields of their names, of a group at its first; false where one has none */
function atFields(place, { errors }) {
  const inputs = errors.map(({ pointer, message }) => {
    const name = CSS.escape(pointer.slice(1));
    /** @type {HTMLElement | null} */
    const input = place.querySelector(`[name="${name}"], [name^="${name}/"]`);
    const id = `wrong${pointer}`;
    // of a field in a group the message begins with its place, which is in sight
    input?.after(h("p.wrong", { id, role: "alert" }, message.replace(/^\w+\W\d\S*: /, "")));
    input?.setAttribute("aria-describedby", id);
    input?.setAttribute("aria-invalid", "true");
    return input;
  });
  inputs[0]?.focus();
  return inputs.length > 0 && !inputs.includes(null);
}

/** @type {(inputs: HTMLInputElement[]) => (number | null)[]} what is typed; a Problem at each that is no number */
export function numbersOf(inputs) {
  const numbers = inputs.map(({ value }) => numberOf(value));
  const errors = inputs.flatMap(({ name, value }, index) =>
    numbers[index] === undefined
      ? [{ pointer: `/${name}`, message: NOT_A_NUMBER, code: "number", row: null, value }]
      : [],
  );
  if (errors.length > 0) throw new Problem(422, { detail: NOT_A_NUMBER, errors });
  return numbers.map((number) => number ?? null);
}

/**
 * Do what is asked for: its buttons rest meanwhile, and `answer` says what is under way, then what went wrong, unless the fields
 * of its form say that.
 * @param {HTMLButtonElement[]} buttons
 * @param {HTMLElement} answer
 * @param {string} status
 * @param {() => Promise<unknown>} work
 * @param {string} [lead] what has not happened
 */
export async function attempted(buttons, answer, status, work, lead) {
  const place = answer.closest("form");
  for (const each of buttons) each.disabled = true;
  for (const old of place?.querySelectorAll(".wrong") ?? []) {
    old.previousElementSibling?.removeAttribute("aria-invalid");
    old.remove();
  }
  answer.replaceChildren(status && quiet(status));
  try {
    await work();
  } catch (problem) {
    const said = place && problem instanceof Problem && atFields(place, problem);
    answer.replaceChildren(said ? "" : problemView(problem, lead));
  } finally {
    for (const each of buttons) each.disabled = false;
  }
}
