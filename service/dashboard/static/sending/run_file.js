// One file that is to be sent: what it is, as far as it or its name says so; and what the service made of it.

import { clutchPath, Problem, send } from "../shared/api.js";
import { field, h, numberInput, offered, quiet, select } from "../shared/dom.js";
import { kindName, runName } from "../shared/format.js";
import { problemView } from "../shared/problem_view.js";
import { importer } from "./importer.js";
import { outcomeOf, receiptView } from "./receipt.js";

/** @typedef {Record<string, unknown> & { kind: string, cycles?: number, clutch_id?: string }} JsonRun a run as the API takes it */
/** @import { Together } from "./importer.js" */

/** @typedef {Record<string, string>} Listed what a list of runs (`runs.json`) says of a file */
const KINDS = offered(["", "stationary_stribeck", "dynamic_stribeck"], (name) => (name ? kindName(name) : "choose …"));
export const SUGGESTED = "suggested by the files’ names and title blocks";
/** Larger JSON is not read here; the service would not take it either. */
export const MOST_JSON_BYTES = 64 * 2 ** 20;
/** Tries while the service is busy, and the wait before each, seconds. Chosen: a busy minute. */
const MOST_TRIES = 6;
const USUAL_WAIT = 2;

/** Numbers the fields of the page: labels need names of their own. */
let count = 0;

/**
 * @param {File} file
 * @param {JsonRun | null} json what a JSON file holds but its channels
 * @param {Together} together the files that came with it
 * @param {Listed} [listed]
 */
export function runFile(file, json, together, listed) {
  const number = (count += 1);
  const kind = select({ id: `kind-${number}`, required: true }, KINDS, listed?.kind ?? "");
  const cycles = numberInput({ id: `cycles-${number}`, value: listed?.cycles ?? "", min: 0, required: true });
  let clutch = "";
  const hints = { kind: h("small"), cycles: h("small") };
  /** @type {(field: HTMLInputElement | HTMLSelectElement, hint: HTMLElement, value: string) => void} until it is changed */
  const suggest = (field, hint, value) => {
    if (field.value !== "") return;
    field.value = value;
    hint.textContent = SUGGESTED;
    field.addEventListener("input", () => hint.replaceChildren(), { once: true });
  };
  /** What the names and the cells above the tables suggest is filled in where nothing is. */
  const suggested = (/** @type {SuggestedRun} */ run) => {
    if (run.kind !== null) suggest(kind, hints.kind, run.kind);
    if (run.cycles !== null) suggest(cycles, hints.cycles, String(run.cycles));
  };
  /** How a file that says nothing of its run itself is read. */
  const fieldsOf = { kind, cycles, clutch: () => clutch, suggested };
  const reading = json || listed ? null : importer(file, number, fieldsOf, together);
  const outcome = h("div.outcome");
  const remark = h("p.remark", { role: "status" });
  const asked = [field(kind, "Kind of test", hints.kind), field(cycles, "Duty cycles since new", hints.cycles)];
  const fields = h("fieldset.fields", json ? null : asked);
  const says = json ? ` · ${runName(json)}` : "";
  const element = h(
    "div.file",
    { role: "group", "aria-label": file.name },
    h("p.name", h("b", file.name), h("span.quiet", ` · ${size(file.size)}`), says),
    remark,
    fields,
    reading && [reading.lead, reading.element],
    outcome,
  );

  /** @type {(id: string) => Promise<Receipt>} stored, after as many tries as a busy service asks for */
  async function tried(id) {
    for (let left = MOST_TRIES - 1; ; left -= 1) {
      try {
        return await store(id);
      } catch (problem) {
        if (!(problem instanceof Problem && problem.status === 503 && left > 0)) throw problem;
        const wait = problem.retryAfter ?? USUAL_WAIT;
        await new Promise((resolve) => setTimeout(resolve, 1000 * wait));
      }
    }
  }

  /** @type {(id: string) => Promise<Receipt>} */
  async function store(id) {
    if (json) {
      const { clutch_id: _, ...run } = JSON.parse(await file.text());
      return (await send("POST", `${clutchPath(id)}/runs`, run)).body;
    }
    const sent = reading?.sent() ?? file;
    /** @type {Record<string, string>} */
    const headers = sent === file ? { "Content-Type": "application/octet-stream" } : {};
    return (await send("POST", `${clutchPath(id)}/runs/file?${question()}`, sent, headers)).body;
  }

  function question() {
    const { run_id, origin, started_at, map } = listed ?? {};
    const query = new URLSearchParams({ kind: kind.value, cycles: cycles.value });
    query.set("filename", file.name.slice(-200));
    const more = { map, rig: reading?.rig(), time: reading?.time(), run_id, origin, started_at };
    for (const [key, value] of Object.entries(more)) if (value) query.set(key, value);
    return query;
  }

  const run = {
    name: file.name,
    json,
    reading,
    element,
    progress: /** @type {"waiting" | "sending" | "stored" | "not stored"} */ ("waiting"),

    /** Cycles by which the files are sent in order; what is not known yet comes last. */
    order: () => {
      const known = json ? json.cycles : cycles.value && Number(cycles.value);
      return typeof known === "number" ? known : Infinity;
    },

    /** @param {string} id a file that names another clutch than the chosen one says so; it is sent all the same */
    compare: (id) => {
      const own = json?.clutch_id;
      clutch = id;
      const other = typeof own === "string" && id !== "" && own !== id;
      remark.textContent = other ? `This file names the clutch ${own}, not ${id}.` : "";
    },

    /** @type {(id: string, alone: boolean) => Promise<Receipt | null>} what comes back is shown, of one alone all */
    send: async (id, alone) => {
      run.progress = "sending";
      fields.disabled = true;
      outcome.replaceChildren(quiet("Sending …"));
      try {
        const receipt = await tried(id);
        run.progress = "stored";
        outcome.replaceChildren(outcomeOf(receipt), alone ? await receiptView(receipt) : folded(receipt));
        return receipt;
      } catch (problem) {
        run.progress = "not stored";
        fields.disabled = false;
        outcome.replaceChildren(problemView(problem));
        return null;
      }
    },
  };
  return run;
}

/** @typedef {ReturnType<typeof runFile>} RunFile */

/** @param {Receipt} receipt read when it is opened */
function folded(receipt) {
  const details = h("details", h("summary", "Receipt"));
  const show = async () => details.append(await receiptView(receipt));
  details.addEventListener("toggle", show, { once: true });
  return details;
}

/** @param {number} bytes */
const size = (bytes) => (bytes < 1e6 ? `${Math.max(1, Math.round(bytes / 1e3))} kB` : `${(bytes / 1e6).toFixed(1)} MB`);
