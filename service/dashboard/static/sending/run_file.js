// @ts-check
// One file that is to be sent: what it is, as far as it or its name says so; and what the service made of it.

import { clutchPath, Problem, send, sendJson } from "../shared/api.js";
import { field, h, quiet, select } from "../shared/dom.js";
import { fixed, kindName } from "../shared/format.js";
import { problemView } from "../shared/problem_view.js";
import { guess } from "./file_name.js";
import { Importer } from "./importer.js";
import { outcomeOf, receiptView } from "./receipt.js";

/** @import { Receipt } from "../shared/types.js" */

/** @typedef {Record<string, unknown> & { kind: string, cycles?: number, clutch_id?: string }} JsonRun a run as the API takes it */
/** @typedef {Record<string, string>} Listed what a list of runs (`runs.json`) says of a file */
/** @typedef {"waiting" | "sending" | "stored" | "not stored"} Progress */

/** @type {[string, string][]} */
const KINDS = [
  ["", "choose …"],
  ["stationary_stribeck", kindName("stationary_stribeck")],
  ["dynamic_stribeck", kindName("dynamic_stribeck")],
];
/** Larger JSON is not read here; the service would not take it either. */
export const MOST_JSON_BYTES = 64 * 2 ** 20;
/** Tries while the service is busy, and the wait before each, seconds. Chosen: a busy minute. */
const MOST_TRIES = 6;
const USUAL_WAIT = 2;

/** Numbers the fields of the page: labels need names of their own. */
let count = 0;

export class RunFile {
  /**
   * @param {File} file
   * @param {JsonRun | null} json what a JSON file holds but its channels
   * @param {Listed | undefined} listed
   */
  constructor(file, json, listed) {
    this.file = file;
    this.json = json;
    this.listed = listed;
    /** @type {Progress} */
    this.progress = "waiting";
    this.outcome = h("div.outcome");
    const number = (count += 1);
    const byName = guess(file.name);
    const kind = listed?.kind ?? byName.kind;
    const cycles = listed?.cycles ?? byName.cycles;
    this.guessed = { kind: !listed && byName.kind !== null, cycles: !listed && byName.cycles !== null };
    this.kind = select({ id: `kind-${number}`, required: true }, KINDS, kind ?? "");
    const numeric = { type: "number", min: 0, step: "any", required: true, inputmode: "decimal" };
    this.cycles = h("input", { id: `cycles-${number}`, value: cycles, ...numeric });
    /** @type {Importer | null} how a file that says nothing of its run itself is read */
    this.importer = null;
    if (!json && !listed) {
      const run = { kind: this.kind, cycles: this.cycles, clutch: () => this.clutch };
      this.importer = new Importer(file, number, run);
    }
    this.clutch = "";
    this.remark = h("p.remark", { role: "status" });
    this.fields = h("fieldset.fields", json ? null : this.fileFields());
    this.element = h(
      "div.file",
      { role: "group", "aria-label": file.name },
      h("p.name", h("b", file.name), h("span.quiet", ` · ${size(file.size)}`), this.run()),
      this.remark,
      this.fields,
      this.importer && [this.importer.lead, this.importer.element],
      this.outcome,
    );
  }

  /** What a JSON run says itself and any other file does not. */
  fileFields() {
    const byName = h("small", "as the file's name says");
    return [
      field(this.kind, "Kind of test", this.guessed.kind && byName.cloneNode(true)),
      field(this.cycles, "Duty cycles since new", this.guessed.cycles && byName.cloneNode(true)),
    ];
  }

  run() {
    return this.json ? ` · ${kindName(this.json.kind)} at ${fixed(this.json.cycles)} cycles` : "";
  }

  /** Cycles by which the files are sent in order; what is not known yet comes last. */
  order() {
    const cycles = this.json ? this.json.cycles : this.cycles.value && Number(this.cycles.value);
    return typeof cycles === "number" ? cycles : Infinity;
  }

  /**
   * A file that names another clutch than the chosen one says so; it is sent all the same.
   * @param {string} id
   */
  compare(id) {
    const own = this.json?.clutch_id;
    this.clutch = id;
    const other = typeof own === "string" && id !== "" && own !== id;
    this.remark.textContent = other ? `This file names the clutch ${own}, not ${id}.` : "";
  }

  /**
   * Send it to a clutch; whatever comes back is shown in its place.
   * @param {string} id
   * @param {boolean} alone whether it is the only file: then its receipt is open
   */
  async send(id, alone) {
    this.progress = "sending";
    this.fields.disabled = true;
    this.outcome.replaceChildren(quiet("Sending …"));
    try {
      const receipt = await this.tried(id);
      this.progress = "stored";
      this.outcome.replaceChildren(outcomeOf(receipt), await this.receipt(receipt, alone));
      return receipt;
    } catch (problem) {
      this.progress = "not stored";
      this.fields.disabled = false;
      this.outcome.replaceChildren(problemView(problem));
      return null;
    }
  }

  /** @type {(receipt: Receipt, open: boolean) => Promise<HTMLElement>} */
  async receipt(receipt, open) {
    if (open) return receiptView(receipt);
    const details = h("details", h("summary", "Receipt"));
    const show = async () => details.append(await receiptView(receipt));
    details.addEventListener("toggle", show, { once: true });
    return details;
  }

  /** @type {(id: string) => Promise<Receipt>} stored, after as many tries as a busy service asks for */
  async tried(id) {
    for (let left = MOST_TRIES - 1; ; left -= 1) {
      try {
        return await this.store(id);
      } catch (problem) {
        if (!(problem instanceof Problem && problem.status === 503 && left > 0)) throw problem;
        const wait = problem.retryAfter ?? USUAL_WAIT;
        await new Promise((resolve) => setTimeout(resolve, 1000 * wait));
      }
    }
  }

  /** @type {(id: string) => Promise<Receipt>} */
  async store(id) {
    if (this.json) {
      const { clutch_id: _, ...run } = JSON.parse(await this.file.text());
      /** @type {{ body: Receipt }} */
      const { body } = await sendJson("POST", `${clutchPath(id)}/runs`, run);
      return body;
    }
    const sent = this.importer?.body() ?? this.file;
    /** @type {Record<string, string>} */
    const headers = sent === this.file ? { "Content-Type": "application/octet-stream" } : {};
    /** @type {{ body: Receipt }} */
    const { body } = await send("POST", this.address(id), sent, headers);
    return body;
  }

  /** @param {string} id */
  address(id) {
    const { run_id: name, origin, started_at: started } = this.listed ?? {};
    const query = new URLSearchParams({ kind: this.kind.value, cycles: this.cycles.value });
    query.set("filename", this.file.name.slice(-200));
    const more = { map: this.listed?.map, rig: this.importer?.rig, run_id: name, origin, started_at: started };
    for (const [key, value] of Object.entries(more)) if (value) query.set(key, value);
    return `${clutchPath(id)}/runs/file?${query}`;
  }
}

/** @param {number} bytes */
const size = (bytes) => (bytes < 1e6 ? `${Math.max(1, Math.round(bytes / 1e3))} kB` : `${(bytes / 1e6).toFixed(1)} MB`);
