// @ts-check
// Sending runs: files that are dropped or chosen go in; for each its receipt, or every place where it is wrong, comes out.
// Open this file first: the dialog. Then batch.js (which files are runs), run_file.js (one of them), file_name.js (what its
// name says), importer.js (how it is read), registration.js (a clutch that is not known yet) and receipt.js (what the service made of a run).

import { clutchPath, Problem, read } from "../shared/api.js";
import { button, field, h } from "../shared/dom.js";
import { problemView } from "../shared/problem_view.js";
import { batchOf } from "./batch.js";
import { IDENTIFIER, register } from "./registration.js";
import { registeredLike, similarRegistered } from "./similar_names.js";

/** @import { Batch } from "./batch.js" */

/** @typedef {{ clutch?: string, sent: () => unknown }} Page without a clutch the reader names it; `sent`: hears of stored runs */

/** @type {(button: HTMLElement, page: Page) => void} make a button and the whole page take files */
export function sender(button, page) {
  takeFiles(button, async (files) => new Sending(await batchOf(files), page).open());
}

class Sending {
  /**
   * @param {Batch} batch
   * @param {Page} page
   */
  constructor(batch, page) {
    this.batch = batch;
    this.page = page;
    this.alone = batch.runs.length === 1;
    const typed = { required: true, list: "registered", autocomplete: "off", spellcheck: "false", ...IDENTIFIER };
    this.clutch = h("input", { id: "to", value: page.clutch ?? namedIn(batch), ...typed });
    this.go = h("button", { class: "main" });
    this.answer = h("div", { class: "answer", role: "status" });
    this.dialog = h("dialog", { "aria-labelledby": "sending-title" });
    this.closed = false;
    this.dialog.addEventListener("close", () => {
      this.closed = true; // a file that is on its way still arrives; the ones after it are not sent
      this.dialog.remove();
    });
  }

  /** The runs that are not stored yet. */
  left() {
    return this.batch.runs.filter((run) => run.progress !== "stored");
  }

  open() {
    const { runs, wrong } = this.batch;
    const suggestions = h("datalist", { id: "registered" });
    const submit = (/** @type {SubmitEvent} */ event) => {
      event.preventDefault();
      this.send();
    };
    const close = button("Close", () => this.dialog.close());
    const elements = runs.map((run) => run.element);
    const compare = () => runs.forEach((run) => run.compare(this.clutch.value.trim()));
    this.clutch.addEventListener("input", compare);
    this.clutch.addEventListener("input", () => this.suggest(suggestions));
    this.suggest(suggestions);
    this.dialog.append(
      h("h2", { id: "sending-title" }, runs.length > 1 ? `Send ${runs.length} runs` : "Send a run"),
      h(
        "form",
        { onsubmit: submit },
        h("div", { class: "fields" }, field(this.clutch, "Clutch", suggestions)),
        wrong.length > 0 ? notRuns(wrong) : "",
        h("div", { class: "files" }, elements),
        this.answer,
        h("div", { class: "buttons" }, close, this.go),
      ),
    );
    this.showGo();
    compare();
    document.body.append(this.dialog);
    this.dialog.showModal();
    this.firstEmpty().focus();
    this.look();
  }

  /**
   * See how the files are read, one after the other. Where saved profiles say all of them and the page says the clutch, they
   * are sent without a question.
   */
  async look() {
    const { runs, wrong } = this.batch;
    for (const { importer } of runs) await importer?.look();
    const decided = runs.length > 0 && wrong.length === 0 && runs.every(({ importer }) => importer?.decided);
    const untouched = !this.closed && runs.every(({ progress }) => progress === "waiting");
    if (decided && untouched && this.clutch.value === this.page.clutch)
      this.dialog.querySelector("form")?.requestSubmit();
  }

  /** @type {(place: HTMLElement) => Promise<void>} offer registered names that contain what is typed */
  async suggest(place) {
    const typed = this.clutch.value.trim();
    const names = await registeredLike(typed).catch(() => []); // sending itself says what is wrong
    if (typed === this.clutch.value.trim()) place.replaceChildren(...names.map((id) => h("option", { value: id })));
  }

  /** The field that the reader has to fill in first, else the button that sends. */
  firstEmpty() {
    const fields = this.dialog.querySelectorAll("input[required], select[required]");
    return (
      /** @type {HTMLElement[]} */ ([...fields]).find((input) => "value" in input && input.value === "") ?? this.go
    );
  }

  showGo() {
    const { length } = this.left();
    const tried = this.batch.runs.some((run) => run.progress !== "waiting");
    const many = this.alone
      ? ""
      : tried
        ? ` the ${length} that ${length === 1 ? "is" : "are"} left`
        : ` ${length} runs`;
    this.go.textContent = `Send${many}${tried && this.alone ? " again" : ""}`;
    this.go.hidden = length === 0;
  }

  async send() {
    this.go.disabled = true;
    this.answer.replaceChildren();
    try {
      const id = await this.registered(this.clutch.value.trim());
      if (id === null) this.answer.replaceChildren(h("p", { class: "notice" }, "Nothing was sent."));
      else await this.sendAll(id);
    } catch (problem) {
      this.answer.replaceChildren(problemView(problem));
    } finally {
      this.go.disabled = false;
      this.showGo();
    }
  }

  /** @param {string} id */
  async sendAll(id) {
    const runs = this.left();
    let held = 0;
    for (const run of runs) {
      if (this.closed) return;
      run.element.scrollIntoView({ block: "nearest" });
      const receipt = await run.send(id, this.alone);
      if (receipt !== null) this.page.sent();
      if (receipt?.state === "held") held += 1;
    }
    const failed = this.left();
    if (!this.alone) this.answer.replaceChildren(summary(runs.length - failed.length, failed.length, held, id));
    (failed[0] ?? this.batch.runs[0])?.element.scrollIntoView({ block: "nearest" });
  }

  /**
   * The registered clutch to send to: the one that was named, or the one that the reader registers or chooses now.
   * @type {(id: string) => Promise<string | null>}
   */
  async registered(id) {
    try {
      await read(clutchPath(id));
      return id;
    } catch (problem) {
      if (!(problem instanceof Problem && problem.status === 404)) throw problem;
    }
    const lead = `No clutch is registered as “${id}”. Nothing has been sent yet.`;
    const chosen = await register(id, { lead, similar: await similarRegistered(id), record: this.batch.record });
    if (chosen !== null) this.clutch.value = chosen;
    return chosen;
  }
}

/** @type {(batch: Batch) => string | undefined} the clutch that the files name themselves, if they agree */
function namedIn({ runs, record }) {
  const names = new Set([record?.clutch_id, ...runs.map((run) => run.json?.clutch_id)].filter(Boolean));
  return names.size === 1 ? [...names][0] : "";
}

/** @param {string[]} wrong */
function notRuns(wrong) {
  const items = wrong.map((text) => h("li", {}, text));
  return h("div", { class: "notice bad" }, h("b", {}, "Not sent, because they are not runs:"), h("ul", {}, items));
}

/** @type {(stored: number, failed: number, held: number, id: string) => HTMLElement} `held`: of those stored */
function summary(stored, failed, held, id) {
  const text = failed > 0 ? `${stored} stored, ${failed} not stored: see each file.` : `All ${stored} stored.`;
  const doubted = held > 0 && ` ${held} of them ${held === 1 ? "is" : "are"} held, and must be confirmed or corrected.`;
  const link = h("a", { href: `/clutches/${encodeURIComponent(id)}` }, `Open ${id}`);
  return h("p", { class: `notice ${failed > 0 ? "bad" : "good"}` }, text, doubted, " ", stored > 0 && link);
}

/** @type {(button: HTMLElement, take: (files: File[]) => unknown) => void} from a button and dropped on the page */
function takeFiles(button, take) {
  const chooser = h("input", { type: "file", multiple: true, hidden: true, "aria-label": "Run files" });
  chooser.addEventListener("change", () => {
    if (chooser.files?.length) take([...chooser.files]);
  });
  document.body.append(chooser);
  button.addEventListener("click", () => {
    chooser.value = "";
    chooser.click();
  });
  takeDropped(take);
}

/** @param {(files: File[]) => unknown} take */
function takeDropped(take) {
  let depth = 0;
  /** @param {number} level elements entered and not yet left */
  const setDepth = (level) => {
    depth = level;
    document.body.classList.toggle("dropping", depth > 0);
  };
  /** @param {DragEvent} event */
  const hasFiles = (event) => event.dataTransfer?.types.includes("Files") ?? false;
  addEventListener("dragenter", (event) => {
    if (hasFiles(event)) setDepth(depth + 1);
  });
  addEventListener("dragleave", () => setDepth(Math.max(0, depth - 1)));
  addEventListener("dragover", (event) => {
    if (hasFiles(event)) event.preventDefault();
  });
  addEventListener("drop", (event) => {
    if (!hasFiles(event)) return;
    event.preventDefault();
    setDepth(0);
    if (document.querySelector("dialog[open]")) return; // one question at a time
    const files = [...(event.dataTransfer?.files ?? [])];
    if (files.length > 0) take(files);
  });
}
