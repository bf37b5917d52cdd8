// Dropped files -> the runs among them: JSON runs, records, and what a campaign's folder says of both (`runs.json`,
// `clutch.json`, as `clutchlife simulate` writes them).

import { MOST_JSON_BYTES, runFile } from "./run_file.js";

/** @import { JsonRun, Listed, RunFile } from "./run_file.js" */
/** @import { ClutchRecord } from "./registration.js" */

const LIST = "runs.json";
const RECORD = "clutch.json";

/** @typedef {{ runs: RunFile[], record: ClutchRecord | null, wrong: string[] }} Batch `wrong`: files that are no run, and why */

/** @type {(files: File[]) => Promise<Batch>} */
export async function batchOf(files) {
  const listed = await listedRuns(files.find((file) => file.name === LIST));
  const record = await object(files.find((file) => file.name === RECORD));
  /** @type {Batch} */
  const batch = { runs: [], record: record && !("kind" in record) ? record : null, wrong: [] };
  const together = {
    names: files.map((file) => file.name),
    readings: () => batch.runs.flatMap(({ reading }) => reading ?? []),
  };
  for (const file of files) {
    if (file.name === LIST && listed !== null) continue;
    if (file.name === RECORD && batch.record !== null) continue;
    if (!/\.json$/i.test(file.name)) batch.runs.push(runFile(file, null, together, listed?.get(file.name)));
    else {
      const run = await jsonRun(file);
      if (typeof run === "string") batch.wrong.push(`${file.name}: ${run}`);
      else batch.runs.push(runFile(file, run, together));
    }
  }
  batch.runs.sort(byOrder);
  return batch;
}

/** @type {(a: RunFile, b: RunFile) => number} by cycles, else by the numbers in their names */
export const byOrder = (a, b) => a.order() - b.order() || a.name.localeCompare(b.name, undefined, { numeric: true });

/** @type {(file: File) => Promise<JsonRun | string>} a JSON run without its channels, or why it is none */
async function jsonRun(file) {
  if (file.size > MOST_JSON_BYTES) return "too large for JSON; send it as CSV, TDMS, MDF4 or Parquet";
  const run = await object(file);
  if (run === null) return "not a run";
  if (typeof run.kind !== "string") return "not a run: its “kind” is missing";
  const { channels: _, ...rest } = run;
  return rest;
}

/** @type {(file: File | undefined) => Promise<any>} what a JSON file holds, null where it is none */
async function content(file) {
  if (file === undefined || file.size > MOST_JSON_BYTES) return null;
  try {
    return JSON.parse(await file.text());
  } catch {
    return null;
  }
}

/** @type {(file: File | undefined) => Promise<any>} a JSON object, or null where the file is none */
async function object(file) {
  const value = await content(file);
  return value !== null && typeof value === "object" && !Array.isArray(value) ? value : null;
}

/** @type {(file: File | undefined) => Promise<Map<string, Listed> | null>} by file name; null without such a list */
async function listedRuns(file) {
  const entries = await content(file);
  const whole = Array.isArray(entries) && entries.every((entry) => entry !== null);
  return whole ? new Map(entries.map((entry) => [entry.file, entry])) : null;
}
