// Changes to what is stored: a run is confirmed, corrected, withdrawn or restored, a clutch archived or brought back. Each is
// asked about, made, said at the foot of the window with the way back (the next change takes its place), and read again.
// Nothing is ever deleted.

import { doubtList } from "../sending/receipt.js";
import { clutchPath, Problem, readAll, send } from "../shared/api.js";
import { asked } from "../shared/dialog.js";
import { button, field, h, select } from "../shared/dom.js";
import { fixed, kindName, words } from "../shared/format.js";
import { problemView } from "../shared/problem_view.js";

/** @typedef {"confirm" | "correct" | "reread" | "withdraw" | "restore"} RunAction */
/** @typedef {{ text: string, undo: (() => Promise<Done>) | null }} Done what was done, in a sentence, and how it is undone */

/** @typedef {Promise<Done | null>} Asked null where the reader leaves the question */

/**
 * @typedef {object} Question
 * @property {string} title
 * @property {(string | HTMLElement)[]} lines what will happen
 * @property {string} action the button's word
 * @property {boolean} [optional] whether it goes without a reason
 * @property {number} [cycles] asked for, and their value at first
 * @property {{ label: string, options: [string, string][] }} [choice] what is chosen, each value with its words
 * @property {string} [note] what the reason is called, where it is another thing
 * @property {(reason: string, cycles: number, chosen: string) => Promise<Done>} send
 */

const LONGEST_REASON = 500;

/** @type {Record<RunAction, string>} */
export const LABELS = {
  confirm: "Confirm …",
  correct: "Correct the cycles …",
  reread: "A column was read wrongly …",
  withdraw: "Withdraw …",
  restore: "Restore …",
};

/** @param {Receipt} run */
export const isCorrected = (run) => run.cycles !== run.sent_cycles;

/**
 * The state as a mark in the list of runs; nothing where the run counts as it was sent.
 * @param {Receipt} run
 */
export function stateMark(run) {
  if (run.state === "held") return h("span.mark-held", "Held");
  if (run.state === "withdrawn") return h("span.mark-withdrawn", "Withdrawn");
  return isCorrected(run) ? h("span.mark-corrected", `Sent as ${fixed(run.sent_cycles)}`) : "";
}

/** @type {(run: Receipt) => RunAction[]} what can be done to a run now */
export function actionsOf({ state, file }) {
  if (state === "withdrawn") return ["restore"];
  /** @type {RunAction[]} */
  const changes = ["correct", ...(file ? /** @type {RunAction[]} */ (["reread"]) : []), "withdraw"];
  return state === "held" ? ["confirm", ...changes] : changes;
}

/** @param {Receipt} run */
const named = (run) => `${kindName(run.kind)} at ${fixed(run.cycles)} cycles`;

/** @param {Receipt} run */
const pathOf = (run) => `${clutchPath(run.clutch_id)}/runs/${encodeURIComponent(run.run_id)}`;

/** @type {(address: string, value: object, method?: "POST" | "PATCH") => Promise<Receipt>} the answer, where it is a run's */
async function post(address, value, method = "POST") {
  /** @type {{ body: Receipt }} */
  const { body } = await send(method, address, value);
  return body;
}

/** @param {{ state: string }} run */
const held = (run) => (run.state === "held" ? " It is held: see its doubts." : "");

/** @type {(run: Receipt, cycles: number, reason: string) => Promise<Done>} */
async function correct(run, cycles, reason) {
  const after = await post(pathOf(run), { cycles, reason }, "PATCH");
  const text = `Corrected from ${fixed(run.cycles)} to ${fixed(after.cycles)} cycles.${held(after)}`;
  return { text, undo: () => correct(after, run.cycles, "the correction is undone") };
}

/** @type {(run: Receipt, reason: string) => Promise<Done>} */
async function confirm(run, reason) {
  await post(`${pathOf(run)}/confirm`, { reason });
  return { text: `${named(run)} is confirmed.`, undo: null };
}

const TURNS = /** @type {const} */ ({
  withdraw: {
    past: "withdrawn",
    noun: "withdrawal",
    back: "restore",
    run: "The run no longer counts, and all results are recomputed without it. Nothing is deleted: you can restore the run.",
    inspection: "It disappears from the charts and stays in the table. Nothing is deleted: you can restore it.",
  },
  restore: {
    past: "restored",
    noun: "restoration",
    back: "withdraw",
    run: "The run returns to the state before its withdrawal, and all results are recomputed.",
    inspection: "It appears in the charts again, with its photographs.",
  },
});

/** @type {(action: keyof typeof TURNS, address: string, name: string, reason: string) => Promise<Done>} */
async function turn(action, address, name, reason) {
  const after = await post(`${address}/${action}`, { reason });
  const { past, noun, back } = TURNS[action];
  const text = `${name} is ${past}.${held(after)}`;
  return { text, undo: () => turn(back, address, name, `the ${noun} is undone`) };
}

/** @type {(action: keyof typeof TURNS, kind: "run" | "inspection", address: string, name: string) => Question} */
const turning = (action, kind, address, name) => ({
  title: `${words(action)} this ${kind}`,
  lines: [TURNS[action][kind]],
  action: words(action),
  send: (reason) => turn(action, address, name, reason),
});

/** @type {(action: keyof typeof TURNS, run: Receipt, reason: string) => Promise<Done>} */
const turnRun = (action, run, reason) => turn(action, pathOf(run), named(run), reason);

/** @type {(run: Receipt) => number | undefined} the cycles that a doubt about a run asks about */
export const likelyCycles = ({ doubts }) => doubts.find((doubt) => doubt.likely_cycles)?.likely_cycles ?? undefined;

/** @typedef {"right" | "likely" | "other"} Answer the run is right, its cycles are those asked about, or it is another clutch's */

/** @type {(run: Receipt) => [Answer, string][]} what can be said of a held run with one click: the button's words */
export function answersOf(run) {
  const likely = likelyCycles(run);
  /** @type {[Answer, string][]} */
  const answers = [["right", "It is right"]];
  if (likely !== undefined) answers.push(["likely", `It is ${fixed(likely)}`]);
  return [...answers, ["other", "It is another clutch’s"]];
}

/** @type {Record<Answer, (run: Receipt) => Promise<Done>>} */
const ANSWERS = {
  right: (run) => confirm(run, ""),
  likely: (run) => correct(run, likelyCycles(run) ?? run.cycles, "wrong cycles, as the doubt suggests"),
  other: (run) => turnRun("withdraw", run, "another clutch's run"),
};

/** @type {(runs: Receipt[], change: "confirm" | "withdraw" | "restore", reason: string) => Promise<Receipt>} */
const changeAll = ([first, ...rest], change, reason) =>
  post(`${clutchPath(first.clutch_id)}/runs/${change}`, { run_ids: [first, ...rest].map((run) => run.run_id), reason });

/** @type {(runs: Receipt[], cycles: Record<string, number>, reason: string) => Promise<Done>} */
async function correctAll(runs, cycles, reason) {
  await post(`${clutchPath(runs[0].clutch_id)}/runs/correct`, { cycles, reason });
  const before = Object.fromEntries(runs.map((run) => [run.run_id, run.cycles]));
  const after = runs.map((run) => ({ ...run, cycles: cycles[run.run_id] }));
  return {
    text: `${runs.length} runs are corrected.`,
    undo: () => correctAll(after, before, "the correction is undone"),
  };
}

/** @type {(turn: keyof typeof TURNS, runs: Receipt[], reason: string) => Promise<Done>} */
async function turnAll(turn, runs, reason) {
  const { past, noun, back } = TURNS[turn];
  await changeAll(runs, turn, reason);
  return { text: `${runs.length} runs are ${past}.`, undo: () => turnAll(back, runs, `the ${noun} is undone`) };
}

/** @type {Record<Answer, (runs: Receipt[]) => Promise<Done>>} */
const ANSWERS_OF_ALL = {
  right: async (runs) => {
    await changeAll(runs, "confirm", "");
    return { text: `${runs.length} runs are confirmed.`, undo: null };
  },
  likely: (runs) => {
    const cycles = Object.fromEntries(runs.map((run) => [run.run_id, likelyCycles(run) ?? run.cycles]));
    return correctAll(runs, cycles, "wrong cycles, as the doubt suggests");
  },
  other: (runs) => turnAll("withdraw", runs, "another clutch's runs"),
};

/** @type {(answer: Answer, runs: Receipt[]) => Promise<Done>} several in one step */
export async function answerDoubts(answer, runs) {
  try {
    return await (runs.length > 1 ? ANSWERS_OF_ALL[answer](runs) : ANSWERS[answer](runs[0]));
  } catch (problem) {
    if (!(problem instanceof Problem)) throw problem;
    return { text: `Nothing was changed: ${problem.detail}`, undo: null };
  }
}

/** @type {(run: Receipt) => Promise<Question>} */
async function rereading(run) {
  /** @type {{ name: string }[]} */
  const rigs = (await readAll("/v1/rigs")).items;
  return {
    title: "Read its file again",
    lines: [
      "Use this if a column was read as the wrong channel or in the wrong unit. First correct the rig profile, or choose " +
        "another one here. Then the stored file is read again, and all results are recomputed.",
    ],
    action: "Read again",
    choice: { label: "Rig profile", options: rigs.map(({ name }) => [name, name]) },
    send: async (reason, _, rig) => {
      await post(pathOf(run), { rig, reason }, "PATCH");
      return { text: `${named(run)} is read by the rig profile ${rig}.`, undo: null };
    },
  };
}

/** @type {Record<RunAction, (run: Receipt) => Question | Promise<Question>>} */
const QUESTIONS = {
  confirm: (run) => ({
    title: "Confirm this run",
    lines: [doubtList(run), "The run is right. From now on it counts like every other run."],
    action: "Confirm",
    optional: true,
    send: (reason) => confirm(run, reason),
  }),
  correct: (run) => ({
    title: "Correct the cycles",
    lines: [
      isCorrected(run) ? `It was sent as ${fixed(run.sent_cycles)} cycles.` : "",
      "The measured data do not change. All results are recomputed with the cycles that you enter here.",
    ],
    action: "Correct",
    cycles: likelyCycles(run) ?? run.cycles,
    send: (reason, cycles) => correct(run, cycles, reason),
  }),
  reread: rereading,
  withdraw: (run) => turning("withdraw", "run", pathOf(run), named(run)),
  restore: (run) => turning("restore", "run", pathOf(run), named(run)),
};

/**
 * Ask about a run.
 * @param {RunAction} action
 * @param {Receipt} run
 * @returns {Asked} null where the reader leaves it
 */
export async function askRun(action, run) {
  const question = await QUESTIONS[action](run);
  const name = h("p", h("b", named(run)), " · ", h("code", run.run_id));
  return ask({ ...question, lines: [name, ...question.lines] });
}

/** @type {(run: Receipt) => Asked} back to the cycles as they were sent */
export const askUndo = (run) =>
  ask({
    title: "Undo the correction",
    lines: [`${named(run)} goes back to the ${fixed(run.sent_cycles)} cycles that were sent.`],
    action: "Undo",
    send: (reason) => correct(run, run.sent_cycles, reason),
  });

/** @type {(inspection: InspectionOut) => Asked} withdraw an inspection, or restore it where it was withdrawn */
export function askInspection({ clutch_id: clutch, inspection_id: id, cycles, state }) {
  const action = state === "withdrawn" ? "restore" : "withdraw";
  const name = `inspection at ${fixed(cycles)} cycles`;
  const address = `${clutchPath(clutch)}/inspections/${id}`;
  const question = turning(action, "inspection", address, `The ${name}`);
  return ask({ ...question, lines: [h("p", h("b", words(name))), ...question.lines] });
}

/** @type {(id: string, archived: boolean) => Asked} archive a clutch, or bring it back; `archived`: what it becomes */
export const askArchive = (id, archived) =>
  ask({
    title: archived ? `Archive ${id}` : `Bring ${id} back`,
    lines: [
      archived
        ? "It disappears from the list of clutches and accepts no new runs. Nothing is deleted: you can bring it back."
        : "It appears in the list of clutches again and accepts new runs.",
    ],
    action: archived ? "Archive" : "Bring back",
    optional: true,
    send: (reason) => archive(id, archived, reason),
  });

/** @type {(id: string, archived: boolean, reason: string) => Promise<Done>} */
async function archive(id, archived, reason) {
  await post(clutchPath(id), { archived, reason }, "PATCH");
  const text = archived ? `${id} is archived.` : `${id} is back in the list of clutches.`;
  return { text, undo: () => archive(id, !archived, `${archived ? "archiving" : "bringing it back"} is undone`) };
}

/** @type {(id: string, cycles: number) => Asked} declare that a clutch's life has ended; `cycles`: of its last run */
export const askEnd = (id, cycles) =>
  ask({
    title: `End of life of ${id}`,
    lines: [
      "The clutch then accepts no duty or tests at later cycles until it is rebuilt. Predictions of similar clutches learn from its life.",
    ],
    action: "Declare the end",
    optional: true,
    cycles,
    choice: {
      label: "Why it has ended",
      options: [
        ["worn", "It is worn"],
        ["other", "Another reason, before it was worn"],
      ],
    },
    note: "Note (optional)",
    send: async (note, at, reason) => {
      const end = { kind: "maintenance", event: "end_of_life", cycles: at, reason, note };
      const run = await post(`${clutchPath(id)}/runs`, end);
      const text = `${id} is declared ended at ${fixed(run.cycles)} cycles.${held(run)}`;
      return { text, undo: () => turnRun("withdraw", run, "the declaration is undone") };
    },
  });

/** @type {(id: string, end: DeclaredEnd) => Asked} take a declared end back */
export const askTakeBack = (id, end) =>
  ask({
    title: "Take the end back",
    lines: [`The life continues after ${fixed(end.cycles)} cycles, and all results are recomputed.`],
    action: "Take it back",
    send: async (reason) => {
      const run = await post(`${clutchPath(id)}/runs/${encodeURIComponent(end.run_id)}/withdraw`, { reason });
      return { text: "The declared end is taken back.", undo: () => turnRun("restore", run, "the end holds again") };
    },
  });

/** @type {(question: Question) => Asked} the question in a dialog */
function ask({ title, lines, action, optional = false, cycles, choice, note, send }) {
  const numeric = { type: "number", min: 0, step: "any", required: true, inputmode: "decimal" };
  const number = h("input", { id: "changed-cycles", value: cycles, ...numeric });
  const reason = h("input", { id: "reason", required: !optional, maxlength: LONGEST_REASON });
  const chosen = select({ id: "chosen", required: true }, choice?.options ?? [], null);
  const closed = asked({
    title,
    lines: lines.map((line) => (typeof line === "string" ? line && h("p", line) : line)),
    fields: [
      cycles === undefined ? null : field(number, "Duty cycles since new"),
      choice ? field(chosen, choice.label) : null,
      field(reason, note ?? (optional ? "Reason (optional)" : "Reason")),
    ],
    action,
    send: () => send(reason.value.trim(), Number(number.value), chosen.value),
  });
  if (cycles !== undefined) number.select();
  return closed;
}

/** @type {HTMLElement | null} */
let shown = null;

/** @type {(done: Done | null, refresh: () => Promise<unknown>) => Promise<void>} `refresh`: reads the clutch again */
export async function showDone(done, refresh) {
  if (done === null) return;
  shown?.remove();
  const { text, undo } = done;
  const place = h("div.row.done", { role: "status", tabindex: "-1" });
  const close = button("Close", () => place.remove());
  const goBack = async () => {
    try {
      await showDone(undo && (await undo()), refresh);
    } catch (problem) {
      place.replaceChildren(problemView(problem, "Not undone. "), close);
    }
  };
  document.body.append(place);
  place.append(h("p", text), undo ? button("Undo", goBack) : "", close);
  shown = place;
  place.focus({ preventScroll: true });
  await refresh();
}
