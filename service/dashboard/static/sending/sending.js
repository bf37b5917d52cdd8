// @ts-check
// Sending a run: a file that is dropped or chosen goes in; its receipt, or every place where it is wrong, comes out.
// Open this file first: the dialog and the requests. receipt.js shows what the service made of a run,
// there and in the clutch page's list of runs.

import { clutchPath, Problem, read, send, sendJson } from "../shared/api.js";
import { h } from "../shared/dom.js";
import { kindName } from "../shared/format.js";
import { problemView } from "../shared/problem_view.js";
import { receiptView } from "./receipt.js";

/** @import { Receipt } from "../shared/types.js" */

/** @typedef {Record<string, unknown> & { kind: string, cycles?: number, clutch_id?: string }} JsonRun a run as the API takes it */

const KINDS = ["stationary_stribeck", "dynamic_stribeck"];
const IDENTIFIER = {
  pattern: "[A-Za-z0-9][A-Za-z0-9._:@+\\-]{0,127}",
  title: "letters, digits and . _ : @ + -",
};
const MOST_JSON_BYTES = 64 * 2 ** 20;

/**
 * Make a button and the whole page take files.
 * @param {HTMLElement} button
 * @param {{ clutches: () => string[], sent: () => unknown }} page the registered ids; hears of a stored run
 */
export function sender(button, { clutches, sent }) {
  /** @param {FileList | null | undefined} files */
  const take = (files) => {
    if (files?.length) new Sending(files[0], clutches(), sent).open();
  };
  const chooser = h("input", { type: "file", hidden: true, "aria-label": "Run file" });
  chooser.addEventListener("change", () => take(chooser.files));
  document.body.append(chooser);
  button.addEventListener("click", () => {
    chooser.value = "";
    chooser.click();
  });
  takeDropped(take);
}

/** @param {(files: FileList | null | undefined) => void} take */
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
    take(event.dataTransfer?.files);
  });
}

class Sending {
  /**
   * @param {File} file
   * @param {string[]} clutches
   * @param {() => unknown} sent
   */
  constructor(file, clutches, sent) {
    this.file = file;
    this.clutches = clutches;
    this.sent = sent;
    /** @type {JsonRun | null} */
    this.json = null;
    this.answer = h("div", { class: "answer", "aria-live": "polite" });
    this.dialog = h("dialog", { "aria-labelledby": "sending-title" });
    this.dialog.addEventListener("close", () => this.dialog.remove());
    this.clutch = h("input", { id: "to", required: true, list: "registered", autocomplete: "off", ...IDENTIFIER });
    this.go = h("button", { class: "main" }, "Send");
    const kinds = KINDS.map((value) => h("option", { value, selected: guess(file.name) === value }, kindName(value)));
    this.kind = h("select", { id: "kind" }, kinds);
    const number = { type: "number", min: 0, step: "any", required: true, inputmode: "decimal" };
    this.cycles = h("input", { id: "cycles", ...number });
    this.map = h("input", { id: "map", placeholder: "torque_nm:Mz,speed_rpm:n", autocomplete: "off" });
  }

  async open() {
    this.json = await jsonRun(this.file);
    this.clutch.value = this.json?.clutch_id ?? this.clutches[0] ?? "";
    const options = this.clutches.map((id) => h("option", { value: id }));
    const run = this.json ? ` · ${kindName(this.json.kind)} at ${this.json.cycles} cycles` : "";
    const submit = (/** @type {SubmitEvent} */ event) => {
      event.preventDefault();
      this.post();
    };
    const close = h("button", { type: "button", onclick: () => this.dialog.close() }, "Close");
    const registered = h("datalist", { id: "registered" }, options);
    this.dialog.append(
      h("h2", { id: "sending-title" }, "Send a run"),
      h("p", {}, h("b", {}, this.file.name), ` · ${size(this.file.size)}`, run),
      h(
        "form",
        { onsubmit: submit },
        h("div", { class: "fields" }, field(this.clutch, "Clutch", registered), this.json ? null : this.fileFields()),
        h("div", { class: "buttons" }, close, this.go),
      ),
      this.answer,
    );
    document.body.append(this.dialog);
    this.dialog.showModal();
    (!this.json && this.clutch.value ? this.cycles : this.clutch).focus();
  }

  /** What a JSON run says itself and any other file does not. */
  fileFields() {
    return [
      field(this.kind, "Kind of test"),
      field(this.cycles, "Duty cycles since new"),
      field(this.map, "Columns by name (only where they are not recognised)"),
    ];
  }

  async post() {
    this.go.disabled = true;
    this.answer.replaceChildren(h("p", { class: "quiet" }, "Sending …"));
    try {
      const id = this.clutch.value.trim();
      await register(id);
      this.answer.replaceChildren(await receiptView(await this.store(id)));
      this.sent();
    } catch (problem) {
      this.answer.replaceChildren(problemView(problem));
    } finally {
      this.go.disabled = false;
      this.answer.scrollIntoView({ block: "nearest" });
    }
  }

  /**
   * @param {string} id
   * @returns {Promise<Receipt>}
   */
  async store(id) {
    if (this.json) {
      const { clutch_id: _, ...run } = this.json;
      /** @type {{ body: Receipt }} */
      const { body } = await sendJson("POST", `${clutchPath(id)}/runs`, run);
      return body;
    }
    /** @type {{ body: Receipt }} */
    const { body } = await send("POST", this.address(id), this.file, { "Content-Type": "application/octet-stream" });
    return body;
  }

  /** @param {string} id */
  address(id) {
    const filename = this.file.name.slice(-200);
    const query = new URLSearchParams({ kind: this.kind.value, cycles: this.cycles.value, filename });
    if (this.map.value.trim()) query.set("map", this.map.value.trim());
    return `${clutchPath(id)}/runs/file?${query}`;
  }
}

/**
 * @param {HTMLInputElement | HTMLSelectElement} input
 * @param {string} text
 * @param {HTMLElement | null} [more]
 */
const field = (input, text, more = null) => h("div", {}, h("label", { for: input.id }, text), input, more);

/**
 * A clutch that is not registered yet is registered with the reference clutch's values.
 * @param {string} id
 */
async function register(id) {
  try {
    await read(clutchPath(id));
  } catch (problem) {
    if (!(problem instanceof Problem && problem.status === 404)) throw problem;
    await sendJson("POST", "/v1/clutches", { clutch_id: id });
  }
}

/**
 * A run as the API takes it, or null where the file is something else.
 * @param {File} file
 * @returns {Promise<JsonRun | null>}
 */
async function jsonRun(file) {
  if (file.size > MOST_JSON_BYTES || !/\.json$/i.test(file.name)) return null;
  try {
    const run = JSON.parse(await file.text());
    return typeof run?.kind === "string" ? run : null;
  } catch {
    return null;
  }
}

/** @param {string} name of the file */
const guess = (name) => (/dyn|loop/i.test(name) ? "dynamic_stribeck" : "stationary_stribeck");

/** @param {number} bytes */
const size = (bytes) => (bytes < 1e6 ? `${Math.max(1, Math.round(bytes / 1e3))} kB` : `${(bytes / 1e6).toFixed(1)} MB`);
