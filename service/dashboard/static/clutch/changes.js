// Changes to what is stored: a run is confirmed, corrected, withdrawn or restored, a clutch archived or brought back. Each is
// asked about, made, said at the foot of the window with the way back (the next change takes its place), and read again.
// Nothing is ever deleted.

import { doubtList } from "../sending/receipt.js";
import { clutchPath, Problem, readAll, send } from "../shared/api.js";
import { asked } from "../shared/dialog.js";
import { button, field, h, numberInput, select } from "../shared/dom.js";
import { fixed, runName, words } from "../shared/format.js";
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

/**
 * Change runs of one clutch in one step; their receipts.
 * @type {(runs: Pick<Receipt, "clutch_id" | "run_id">[], change: Turn | "confirm" | "correct", reason: string, more?: object) => Promise<Receipt[]>}
 */
async function changeRuns(runs, change, reason, more = { run_ids: runs.map((run) => run.run_id) }) {
  return (await send("POST", `${clutchPath(runs[0].clutch_id)}/runs/${change}`, { ...more, reason })).body.items;
}

/** @type {(runs: Receipt[]) => string} runs and a verb, as a sentence begins */
const they = (runs) => (runs.length === 1 ? `${runName(runs[0])} is` : `${runs.length} runs are`);

/** @param {{ state: string }[]} changed */
function held(changed) {
  if (changed.every(({ state }) => state !== "held")) return "";
  return changed.length === 1 ? " It is held: see its doubts." : " Some of them are held: see their doubts.";
}

/** @type {(runs: Receipt[], cycles: (run: Receipt) => number, reason: string) => Promise<Done>} */
async function correct(runs, cycles, reason) {
  const wanted = Object.fromEntries(runs.map((run) => [run.run_id, cycles(run)]));
  const after = await changeRuns(runs, "correct", reason, { cycles: wanted });
  const before = new Map(runs.map((run) => [run.run_id, run.cycles]));
  const one = `Corrected from ${fixed(runs[0].cycles)} to ${fixed(after[0].cycles)} cycles.`;
  return {
    text: (runs.length === 1 ? one : `${they(runs)} corrected.`) + held(after),
    undo: () => correct(after, (run) => before.get(run.run_id) ?? run.cycles, "the correction is undone"),
  };
}

/** @type {(runs: Receipt[], reason: string) => Promise<Done>} */
async function confirm(runs, reason) {
  await changeRuns(runs, "confirm", reason);
  return { text: `${they(runs)} confirmed.`, undo: null };
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

/** @typedef {keyof typeof TURNS} Turn */
/** @typedef {{ kind: "run" | "inspection", they: string, make: (turn: Turn, reason: string) => Promise<{ state: string }[]> }} Turned */

/** @type {(turn: Turn, of: Turned, reason: string) => Promise<Done>} */
async function turn(action, of, reason) {
  const after = await of.make(action, reason);
  const { past, noun, back } = TURNS[action];
  return { text: `${of.they} ${past}.${held(after)}`, undo: () => turn(back, of, `the ${noun} is undone`) };
}

/** @type {(runs: Receipt[]) => Turned} */
const turned = (runs) => ({
  kind: "run",
  they: they(runs),
  make: (action, reason) => changeRuns(runs, action, reason),
});

/** @type {(action: Turn, of: Turned) => Question} */
const turning = (action, of) => ({
  title: `${words(action)} this ${of.kind}`,
  lines: [TURNS[action][of.kind]],
  action: words(action),
  send: (reason) => turn(action, of, reason),
});

/** @type {(run: Receipt) => number | undefined} the cycles that a doubt about a run asks about */
const likelyCycles = ({ doubts }) => doubts.find((doubt) => doubt.likely_cycles)?.likely_cycles ?? undefined;

/** @typedef {"right" | "likely" | "other"} Answer the runs are right, their cycles are those asked about, or they are another clutch's */

/** @type {(runs: Receipt[]) => [Answer, string][]} what can be said of held runs with one click: the button's words */
export function answersOf(runs) {
  const [they, likely] =
    runs.length === 1
      ? ["It is", `It is ${fixed(likelyCycles(runs[0]))}`]
      : [`All ${runs.length} are`, `Correct all ${runs.length}`];
  /** @type {[Answer, string][]} */
  const answers = [["right", `${they} right`]];
  if (runs.every((run) => likelyCycles(run) !== undefined)) answers.push(["likely", likely]);
  return [...answers, ["other", `${they} another clutch’s`]];
}

/** @type {Record<Answer, (runs: Receipt[]) => Promise<Done>>} */
const ANSWERS = {
  right: (runs) => confirm(runs, ""),
  likely: (runs) => correct(runs, (run) => likelyCycles(run) ?? run.cycles, "wrong cycles, as the doubt suggests"),
  other: (runs) => turn("withdraw", turned(runs), "another clutch's run"),
};

/** @type {(answer: Answer, runs: Receipt[]) => Promise<Done>} several in one step */
export async function answerDoubts(answer, runs) {
  try {
    return await ANSWERS[answer](runs);
  } catch (problem) {
    if (!(problem instanceof Problem)) throw problem;
    return { text: `Nothing was changed: ${problem.detail}`, undo: null };
  }
}

/** @type {(run: Receipt) => Promise<Question>} */
async function rereading(run) {
  const { items: rigs } = await readAll("/v1/rigs");
  return {
    title: "Read its file again",
    lines: [
      "Use this if a column was read as the wrong channel or in the wrong unit. First correct the rig profile, or choose " +
        "another one here. Then the stored file is read again, and all results are recomputed.",
    ],
    action: "Read again",
    choice: { label: "Rig profile", options: rigs.map(({ name }) => [name, name]) },
    send: async (reason, _, rig) => {
      await send("PATCH", `${clutchPath(run.clutch_id)}/runs/${encodeURIComponent(run.run_id)}`, { rig, reason });
      return { text: `${runName(run)} is read by the rig profile ${rig}.`, undo: null };
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
    send: (reason) => confirm([run], reason),
  }),
  correct: (run) => ({
    title: "Correct the cycles",
    lines: [
      isCorrected(run) ? `It was sent as ${fixed(run.sent_cycles)} cycles.` : "",
      "The measured data do not change. All results are recomputed with the cycles that you enter here.",
    ],
    action: "Correct",
    cycles: likelyCycles(run) ?? run.cycles,
    send: (reason, cycles) => correct([run], () => cycles, reason),
  }),
  reread: rereading,
  withdraw: (run) => turning("withdraw", turned([run])),
  restore: (run) => turning("restore", turned([run])),
};

/**
 * Ask about a run.
 * @param {RunAction} action
 * @param {Receipt} run
 * @returns {Asked} null where the reader leaves it
 */
export async function askRun(action, run) {
  const question = await QUESTIONS[action](run);
  const name = h("p", h("b", runName(run)), " · ", h("code", run.run_id));
  return ask({ ...question, lines: [name, ...question.lines] });
}

/** @type {(run: Receipt) => Asked} back to the cycles as they were sent */
export const askUndo = (run) =>
  ask({
    title: "Undo the correction",
    lines: [`${runName(run)} goes back to the ${fixed(run.sent_cycles)} cycles that were sent.`],
    action: "Undo",
    send: (reason) => correct([run], () => run.sent_cycles, reason),
  });

/** @type {(inspection: InspectionOut) => Asked} withdraw an inspection, or restore it where it was withdrawn */
export function askInspection({ clutch_id: clutch, inspection_id: id, cycles, state }) {
  const action = state === "withdrawn" ? "restore" : "withdraw";
  const name = `inspection at ${fixed(cycles)} cycles`;
  /** @type {Turned["make"]} */
  const make = async (now, reason) => [
    (await send("POST", `${clutchPath(clutch)}/inspections/${id}/${now}`, { reason })).body,
  ];
  const question = turning(action, { kind: "inspection", they: `The ${name} is`, make });
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
  await send("PATCH", clutchPath(id), { archived, reason });
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
      const { body: run } = await send("POST", `${clutchPath(id)}/runs`, end);
      const text = `${id} is declared ended at ${fixed(run.cycles)} cycles.${held([run])}`;
      return { text, undo: () => turn("withdraw", turned([run]), "the declaration is undone") };
    },
  });

/** @type {(id: string, end: DeclaredEnd) => Asked} take a declared end back */
export const askTakeBack = (id, end) =>
  ask({
    title: "Take the end back",
    lines: [`The life continues after ${fixed(end.cycles)} cycles, and all results are recomputed.`],
    action: "Take it back",
    send: async (reason) => {
      const runs = await changeRuns([{ clutch_id: id, run_id: end.run_id }], "withdraw", reason);
      return {
        text: "The declared end is taken back.",
        undo: () => turn("restore", turned(runs), "the end holds again"),
      };
    },
  });

/** @type {(question: Question) => Asked} the question in a dialog */
function ask({ title, lines, action, optional = false, cycles, choice, note, send }) {
  const number = numberInput({ id: "changed-cycles", value: cycles, min: 0, required: true });
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
