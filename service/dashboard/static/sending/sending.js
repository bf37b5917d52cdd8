// Sending runs: files that are dropped or chosen go in; for each its receipt, or every place where it is wrong, comes out.
// Open this file first: the dialog, which taking.js loads. Then batch.js (which files are runs), run_file.js (one of them),
// importer.js (how it is read), registration.js (a clutch that is not known yet) and
// receipt.js (what the service made of a run).

import { clutchPath, pageOf, readIfThere } from "../shared/api.js";
import { answered, button, field, form, h } from "../shared/dom.js";
import { attempted } from "../shared/problem_view.js";
import { batchOf, byOrder } from "./batch.js";
import { IDENTIFIER, register } from "./registration.js";
import { SUGGESTED } from "./run_file.js";
import { registeredLike, similarRegistered } from "./similar_names.js";

/** @import { Batch } from "./batch.js" */
/** @import { Page } from "./taking.js" */

/** @type {(files: File[], page: Page) => Promise<void>} */
export const sendFiles = async (files, page) => open(await batchOf(files), page);

/** @type {(batch: Batch, page: Page) => void} the dialog that sends them */
function open(batch, page) {
  const { runs, wrong } = batch;
  const alone = runs.length === 1;
  const naming = { required: true, list: "registered", spellcheck: "false", ...IDENTIFIER };
  const clutch = h("input", { id: "to", value: page.clutch ?? namedIn(batch), ...naming });
  const suggestions = h("datalist", { id: "registered" });
  const hint = h("small");
  const answer = h("div.answer", { role: "status" });
  const go = h("button.main");
  const submit = async () => {
    await attempted([go], answer, "", send);
    showGo();
  };
  const close = button("Close", () => dialog.close());
  const elements = runs.map((run) => run.element);
  const typed = form(
    submit,
    h("div.fields", field(clutch, "Clutch", [hint, suggestions])),
    wrong.length > 0 ? notRuns(wrong) : "",
    h("div.listed", elements),
    answer,
    h("div.row.buttons", close, go),
  );
  const title = h("h2", { id: "sending-title" }, runs.length > 1 ? `Send ${runs.length} runs` : "Send a run");
  const dialog = h("dialog", { "aria-labelledby": "sending-title" }, title, typed);

  /** The runs that are not stored yet. */
  const left = () => runs.filter((run) => run.progress !== "stored");

  /** A file that is on its way when the dialog is closed still arrives; the ones after it are not sent. */
  const closed = () => !dialog.open;

  function typedName() {
    const name = clutch.value.trim();
    for (const run of runs) run.compare(name);
    suggest(name);
  }

  /** @type {(name: string) => Promise<void>} offer registered names that contain what is typed */
  async function suggest(name) {
    const names = await registeredLike(name).catch(() => []); // sending itself says what is wrong
    if (name === clutch.value.trim()) suggestions.replaceChildren(...names.map((id) => h("option", { value: id })));
  }

  /**
   * See how the files are read, one after the other. Where saved profiles say all of them and the page says the clutch, they
   * are sent without a question.
   */
  async function look() {
    for (const { reading } of runs) await reading?.look();
    suggestClutch();
    const decided = runs.length > 0 && wrong.length === 0 && runs.every(({ reading }) => reading?.decided());
    const untouched = !closed() && runs.every(({ progress }) => progress === "waiting");
    if (decided && untouched && clutch.value === page.clutch) typed.requestSubmit();
  }

  /** The clutch that the files' names or title blocks say, if they agree, where none is named. */
  function suggestClutch() {
    const ids = new Set(runs.flatMap(({ reading }) => reading?.clutch() ?? []));
    if (clutch.value !== "" || ids.size !== 1) return;
    [clutch.value] = ids;
    hint.textContent = SUGGESTED;
    typedName();
  }

  function showGo() {
    const { length } = left();
    const tried = runs.some((run) => run.progress !== "waiting");
    const rest = tried ? ` the ${length} that ${length === 1 ? "is" : "are"} left` : ` ${length} runs`;
    go.textContent = `Send${alone ? "" : rest}${tried && alone ? " again" : ""}`;
    go.hidden = length === 0;
  }

  async function send() {
    const id = await registered(clutch.value.trim());
    if (id === null) answer.replaceChildren(h("p.notice", "Nothing was sent."));
    else await sendAll(id);
  }

  /** @param {string} id */
  async function sendAll(id) {
    const all = left().sort(byOrder);
    let held = 0;
    for (const run of all) {
      if (closed()) return;
      run.element.scrollIntoView({ block: "nearest" });
      const receipt = await run.send(id, alone);
      if (receipt !== null) page.sent();
      if (receipt?.state === "held") held += 1;
    }
    const failed = left();
    if (!alone) answer.replaceChildren(summary(all.length - failed.length, failed.length, held, id));
    (failed[0] ?? runs[0])?.element.scrollIntoView({ block: "nearest" });
  }

  /**
   * The registered clutch to send to: the one that was named, or the one that the reader registers or chooses now.
   * @type {(id: string) => Promise<string | null>}
   */
  async function registered(id) {
    if (await readIfThere(clutchPath(id))) return id;
    const lead = `No clutch is registered as “${id}”. Nothing has been sent yet.`;
    const chosen = await register(id, { lead, similar: await similarRegistered(id), record: batch.record });
    if (chosen !== null) clutch.value = chosen;
    return chosen;
  }

  clutch.addEventListener("input", () => {
    hint.replaceChildren();
    typedName();
  });
  typedName();
  showGo();
  void answered(dialog, () => null);
  // the field that the reader has to fill in first, else the button that sends
  const fields = /** @type {HTMLInputElement[]} */ ([...typed.querySelectorAll("input[required], select[required]")]);
  (fields.find((input) => input.value === "") ?? go).focus();
  look();
}

/** @type {(batch: Batch) => string | undefined} the clutch that the files name themselves, if they agree */
function namedIn({ runs, record }) {
  const names = new Set([record?.clutch_id, ...runs.map((run) => run.json?.clutch_id)].filter(Boolean));
  return names.size === 1 ? [...names][0] : "";
}

/** @param {string[]} wrong */
function notRuns(wrong) {
  const items = wrong.map((text) => h("li", text));
  return h("div.notice.bad", h("b", "Not sent, because they are not runs:"), h("ul", items));
}

/** @type {(stored: number, failed: number, held: number, id: string) => HTMLElement} `held`: of those stored */
function summary(stored, failed, held, id) {
  const text = failed > 0 ? `${stored} stored, ${failed} not stored: see each file.` : `All ${stored} stored.`;
  const doubted = held > 0 && ` ${held} of them ${held === 1 ? "is" : "are"} held, and must be confirmed or corrected.`;
  const link = h("a", { href: pageOf(id) }, `Open ${id}`);
  return h("p", { class: `notice ${failed > 0 ? "bad" : "good"}` }, text, doubted, " ", stored > 0 && link);
}
