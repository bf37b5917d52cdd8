// How one file is read: its first rows, each column with its channel, unit and scale to choose from, what will be cut and
// fitted, drawn before anything is sent; and the rig profile that the choices are kept in.

import { drawnAlone } from "../charts/draw.js";
import { band, planar } from "../charts/traces.js";
import { send } from "../shared/api.js";
import { button, field, h, numberInput, offered, quiet, scrolling, select } from "../shared/dom.js";
import { quantity, words } from "../shared/format.js";
import { problemView } from "../shared/problem_view.js";
import { warnings } from "./receipt.js";

/** @import { Attributes, Content } from "../shared/dom.js" */
/** @typedef {{ names: string[], readings: () => Importer[] }} Together the files that were dropped together */
/** @typedef {ReturnType<typeof importer>} Importer */

/** Rows that are shown. */
const ROWS = 5;
/** Who chooses by typing a list's words is not interrupted by the answer to their first letter. */
const PAUSE_MS = 400;
/** Names of other files that are told, so that an address keeps its length. */
const MOST_NAMES = 40;

/**
 * @param {File} file
 * @param {number} number tells its fields from those of other files
 * @param {{ kind: HTMLSelectElement, cycles: HTMLInputElement, clutch: () => string,
 *   suggested: (run: SuggestedRun) => void }} run
 * @param {Together} together
 */
export function importer(file, number, run, together) {
  /** @type {Preview | null} */
  let preview = null;
  /** @type {RigProfile | null} the choices, where they are not those of a saved profile */
  let chosen = null;
  let questions = 0;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  let soon;
  // what was typed stays when the rest is drawn again
  const rigName = h("input", { id: `rig-${number}`, spellcheck: "false" });
  const pattern = h("input", { id: `pattern-${number}` });
  /** The time column of a suggestion, where no column of the profile says it. */
  let time = "";
  const lead = h("p.quiet", { role: "status" }, "Reading …");
  const content = h("div");
  const element = h("details.import", h("summary", "Columns, units, and what is fitted"), content);
  for (const input of [run.kind, run.cycles]) input.addEventListener("change", () => look());

  /** Whether a saved profile says all of it: then nothing is asked. */
  const decided = () =>
    preview !== null && preview.rig !== null && preview.missing.length === 0 && preview.problem === null;

  /** The saved profile that the file is sent with. */
  const rig = () => (chosen === null ? (preview?.rig ?? null) : null);

  /** Ask how the file is read; an answer that came after a newer question is dropped. */
  async function look() {
    const question = (questions += 1);
    const first = preview === null; // what only the file's name suggests is no profile's word
    const { kind, cycles, clutch } = run;
    const query = new URLSearchParams({ filename: file.name.slice(-200) });
    const own = first ? {} : { kind: kind.value, cycles: cycles.value };
    const more = { ...own, clutch_id: clutch(), rig: rig(), time: chosen && time };
    for (const [name, value] of Object.entries(more)) if (value) query.set(name, value);
    const others = together.names.filter((name) => name !== file.name).slice(0, MOST_NAMES);
    for (const name of others) query.append("together", name.slice(-200));
    try {
      const { body } = await send("POST", `/v1/import/preview?${query}`, sent());
      if (question !== questions) return;
      if (first) run.suggested(body.suggested_run);
      show(body);
      if (first && body.rig === null && (kind.value || cycles.value)) await look();
    } catch (problem) {
      if (question !== questions) return;
      lead.replaceChildren();
      content.replaceChildren(problemView(problem));
    }
  }

  /** The file, in a form with the choices where there are any. */
  function sent() {
    if (chosen === null) return file;
    const form = new FormData();
    form.append("profile", JSON.stringify(chosen));
    form.append("file", file);
    return form;
  }

  /** @param {Preview} shown */
  function show(shown) {
    preview = shown;
    // without a profile the kind is stated where it is the only one that has these channels
    if (shown.kind !== null && (rig() !== null || run.kind.value === "")) run.kind.value = shown.kind;
    if (shown.cycles !== null && rig() !== null) run.cycles.value = String(shown.cycles);
    const focused = document.activeElement?.id;
    const left = shown.missing.map(quantity).join(", ");
    const ready = shown.suggestion === null ? "Ready to send." : "Its reading is suggested: check it, then confirm.";
    const state = shown.problem ?? (left ? `Still missing: ${left}.` : ready);
    lead.replaceChildren(rig() === null ? "" : h("b", `Read by the rig profile ${rig()}. `), state);
    element.open ||= shown.problem !== null || channelsLack() || (shown.suggestion !== null && isFirst(shown));
    content.replaceChildren(confirming(shown) ?? "", columnsTable(shown), options(shown), drawing(shown) ?? "");
    const noted = warnings(shown.warnings);
    if (noted) content.append(noted);
    if (shown.suggestion === null) content.append(saving(shown));
    if (focused) document.getElementById(focused)?.focus(); // what was chosen in was drawn again
  }

  /** @type {(shown: Preview) => boolean} whether no file before it has the same columns */
  function isFirst({ columns }) {
    const like = together.readings().find((reading) => reading.titles() === titlesOf(columns));
    return like === undefined || like.element === element;
  }

  /** @param {Preview} shown what asks for a confirmation, null where nothing is suggested */
  function confirming(shown) {
    const { suggestion, columns } = shown;
    if (suggestion === null) return null;
    if (!isFirst(shown)) return quiet("Suggested as in the first file with these columns: confirm it there.");
    const box = h("input", { id: `confirm-${number}`, type: "checkbox", required: true });
    box.addEventListener("change", () => {
      for (const reading of together.readings()) reading.confirm(titlesOf(columns));
    });
    const sure = `${Math.round(100 * Number(suggestion.confidence))} %`;
    return h(
      "div.notice",
      h(
        "p",
        h("b", "Suggested, not certain. "),
        `Confidence ${sure}. It is not read without a question: ${suggestion.why}.`,
      ),
      h("label", box, " The channels, units and rows below are right, for these files"),
      saving(shown),
    );
  }

  /** @type {(titles: string) => void} the suggestion is confirmed, if the file has these columns */
  function confirm(titles) {
    if (!preview?.suggestion || titlesOf(preview.columns) !== titles) return;
    time = preview.suggestion.time;
    edit(() => {});
  }

  function channelsLack() {
    return preview?.missing.some((name) => !["kind", "cycles"].includes(name)) ?? false;
  }

  /** @param {Preview} shown */
  function columnsTable({ columns, first_rows: rows, units }) {
    /** @type {(name: string, cells: Content[]) => HTMLElement} */
    const line = (name, cells) =>
      h(
        "tr",
        h("th", { scope: "row" }, name),
        cells.map((cell) => h("td", cell)),
      );
    const chosen = columns.map((column, index) => choices(column, index, units));
    const choosing = ["Channel", "Unit", "Scale", "Offset"].map((name, at) =>
      line(
        name,
        chosen.map((column) => column[at]),
      ),
    );
    const first = rows.slice(0, ROWS).map((row, at) =>
      line(
        `Row ${at + 1}`,
        columns.map((_, index) => row[index] ?? ""),
      ),
    );
    const titles = columns.map(({ title }) => h("th", { scope: "col" }, title));
    const caption = h("caption.hidden", `First rows of ${file.name}`);
    const head = h("thead", h("tr", h("th", { scope: "row" }, "Column"), titles));
    return scrolling("First rows", h("table.columns", caption, head, h("tbody", choosing, first)));
  }

  /** @type {(column: PreviewColumn, index: number, units: Record<string, string[]>) => Content[]} channel, unit, scale, offset */
  function choices(column, index, units) {
    const { title, channel, unit, stated_unit: stated } = column;
    /** @type {(name: string, change: (value: string | null, columns: RigColumn[]) => Partial<RigColumn>) => Attributes} */
    const attributes = (name, change) => ({
      id: `import-${number}-${name}-${index}`,
      "aria-label": `${words(name)} of ${title}`,
      onchange: ({ target }) =>
        edit(({ columns }) => Object.assign(columns[index], change(target.value || null, columns))),
    });
    const taking = attributes("channel", (value, columns) => {
      for (const other of columns) if (other.channel === value) Object.assign(other, { channel: null, unit: null });
      return { channel: /** @type {RigColumn["channel"]} */ (value), unit: null, stated: null };
    });
    const list = select(taking, [["", "left out"], ...offered(Object.keys(units), quantity)], channel ?? "");
    if (channel === null) return [list, stated ?? "", "", ""];
    const known = units[channel] ?? [];
    const names = unit === null ? ["", ...known] : known.includes(unit) ? known : [unit, ...known];
    const measured = attributes("unit", (value) => ({ unit: value, stated }));
    /** @param {"scale" | "offset"} name */
    const factor = (name) => {
      const scaled = attributes(name, (value) => ({ [name]: Number(value) }));
      return numberInput({ ...scaled, required: true, value: column[name] });
    };
    const unitOptions = offered(names, (name) => name || "choose …");
    return [list, select(measured, unitOptions, unit), factor("scale"), factor("offset")];
  }

  /** @param {Preview} shown */
  function options({ profile, tables, problem }) {
    const attributes = (/** @type {"decimal" | "table" | "missing" | "good"} */ name) => ({
      id: `${name}-${number}`,
      onchange: (/** @type {any} */ event) => {
        const { value } = event.target; // a sheet's name may end in a space
        edit((edited) => Object.assign(edited, { [name]: (name === "table" ? value : value.trim()) || null }));
      },
    });
    const marks = Object.entries({ "": "found", ",": "comma: 1.234,5", ".": "point: 1,234.5" });
    const sheets = offered(["", ...tables], (name) => name || "the only one");
    const missing = h("input", { ...attributes("missing"), value: profile.missing ?? "" });
    const good = h("input", { ...attributes("good"), value: profile.good ?? "" });
    const asked = profile.good !== null || problem?.includes("good=");
    return h(
      "div.fields",
      field(select(attributes("decimal"), marks, profile.decimal ?? ""), "Decimal mark"),
      field(missing, "Missing values", h("small", "for example -9999, n/a; “none” if every number is a measurement")),
      asked && field(good, "Codes of good rows", h("small", "for example 0 or 192; “none” reads all rows")),
      tables.length > 1 && field(select(attributes("table"), sheets, profile.table ?? ""), "Sheet or test"),
    );
  }

  /** @param {(profile: RigProfile) => unknown} change */
  function edit(change) {
    if (preview === null) return;
    const profile = structuredClone(chosen ?? preview.profile);
    change(profile);
    chosen = profile;
    questions += 1; // an answer to what was chosen before is of no use
    clearTimeout(soon);
    soon = setTimeout(() => look(), PAUSE_MS);
  }

  /** @param {Preview} shown */
  function saving({ profile, missing, problem, suggestion }) {
    if (rig() !== null) return quiet("The next file with these columns is read the same way.");

    pattern.value ||= profile.file_name ?? "";
    const answer = h("div", { role: "status" });
    const save = async () => {
      const kept = { ...profile, name: rigName.value.trim(), file_name: pattern.value.trim() || null };
      try {
        await send("POST", "/v1/rigs", { ...kept, kind: run.kind.value || profile.kind });
        chosen = null;
        if (preview) preview.rig = kept.name;
        await look();
        for (const other of together.readings()) if (other.rig() === null) await other.look();
      } catch (refused) {
        answer.replaceChildren(problemView(refused));
      }
    };
    const ready = problem === null && !channelsLack() && !missing.includes("kind");
    return h(
      "fieldset.saving",
      h("legend", suggestion ? "Or keep this reading for all files of the rig" : "Read the next file the same way"),
      h(
        "div.fields",
        field(rigName, "Name of the rig"),
        field(pattern, "File names", h("small", "{cycles} is the duty cycles, {clutch_id} the clutch, * any text")),
      ),
      button(suggestion ? "Confirm and save as rig profile" : "Save as rig profile", save, { disabled: !ready }),
      answer,
    );
  }

  return {
    lead,
    element,
    decided,
    rig,
    look,
    sent,
    confirm,
    titles: () => preview && titlesOf(preview.columns),
    time: () => (chosen === null ? "" : time),
    /** The clutch that the name or the title block says. */
    clutch: () => preview?.clutch_id ?? preview?.suggested_run.clutch_id ?? null,
  };
}

/** @param {PreviewColumn[]} columns */
const titlesOf = (columns) => columns.map(({ title }) => title).join("\n");

/**
 * The record with what is cut of it, or the plateaus; null where nothing is read.
 * @param {Preview} shown
 */
function drawing({ channels, pieces, fits, kind }) {
  const { time_s: time, torque_nm: torque, speed_rpm: speed } = channels;
  const x = time ?? speed;
  if (!torque?.length || !x) return null;
  const [low, high] = [Math.min(0, ...torque), Math.max(...torque)];
  const piece = kind === "dynamic_stribeck" ? "stretches of constant pressure" : "plateaus";
  const found = time ? `${pieces.length} ${piece} are cut` : `${torque.length} plateaus`;
  const text = `Torque over ${time ? "time" : "speed"}: ${found}, ${fits.length} curves are fitted.`;
  const figure = planar(time ? "time, s" : "speed, rpm", "torque, Nm", [], (c) => [
    ...pieces.map(({ start_s: from, stop_s: to }) =>
      band("", { x: [from, to], y: [low, low] }, { x: [from, to], y: [high, high] }, c),
    ),
    {
      x,
      y: torque,
      ...(time ? { line: { color: c.accent, width: 1 } } : { marker: { color: c.accent, size: 4 } }),
    },
  ]);
  return h("figure.cutting", drawnAlone(figure, { width: 760, height: 220 }, text), h("figcaption", text));
}
