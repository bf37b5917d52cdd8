// A problem as the reader sees it, with every place that is wrong in what was sent.

import { Problem } from "./api.js";
import { h, quiet, scrolling, table } from "./dom.js";

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

/**
 * Do what is asked for: its buttons rest meanwhile, and `answer` says what is under way, then what went wrong.
 * @param {HTMLButtonElement[]} buttons
 * @param {HTMLElement} answer
 * @param {string} status
 * @param {() => Promise<unknown>} work
 * @param {string} [lead] what has not happened
 */
export async function attempted(buttons, answer, status, work, lead) {
  for (const each of buttons) each.disabled = true;
  answer.replaceChildren(status && quiet(status));
  try {
    await work();
  } catch (problem) {
    answer.replaceChildren(problemView(problem, lead));
  } finally {
    for (const each of buttons) each.disabled = false;
  }
}
