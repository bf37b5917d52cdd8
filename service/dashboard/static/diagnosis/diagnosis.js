// The diagnosis: reports of the API go in; verdict, tables, charts and the buttons to run and adopt it come out.
// Open this file first, then report.js (a report in words and tables) and charts.js (residuals and loops, before and after);
// the first also shows remaining life before and after the model changes.

import { chartsOf } from "../charts/chart.js";
import { read, send } from "../shared/api.js";
import { agreed } from "../shared/dialog.js";
import { button, computing, h, quiet, section } from "../shared/dom.js";
import { words } from "../shared/format.js";
import { attempted } from "../shared/problem_view.js";
import { charts } from "./charts.js";
import { lifeBars, report as reportView } from "./report.js";

const QUESTION =
  "Do the data and the model disagree beyond noise and run-to-run scatter? If so: where, and which physical cause accounts for it?";
const NEVER_RUN = "No diagnosis has been run yet. It reads the stored runs and changes nothing.";

/** @param {BeforeAndAfter | null | undefined} life remaining life under both models */
const nowAndThen = (life) => life && lifeBars(life, ["Now", "Then"]);

/** @typedef {{ path: ClutchPath, present: () => Pick<ClutchOut, "runs">, life: () => Promise<RemainingLife> }} Reader of a clutch */

/**
 * @param {HTMLElement} place of the tab
 * @param {Reader} reader
 * @param {() => Promise<void>} changed hears that the clutch's model is another now
 */
export function diagnosisTab(place, reader, changed) {
  const path = /** @type {const} */ (`${reader.path}/diagnoses`);
  /** @type {DiagnosisOut | null} */
  let latest = null;
  /** @type {ModelName | null} under which the clutch is tracked now */
  let model = null;
  let due = true;
  const run = button("Run the diagnosis", start, { class: "main" });
  const answer = h("div", { role: "status" });
  const content = h("div");
  const drawings = charts();
  const figures = chartsOf(...drawings.map(({ chart }) => chart));
  figures.hidden = true;
  const buttons = h("div.row.buttons.start", run);
  const panel = h("div.panel.diagnosis", h("p.question", QUESTION), buttons, answer, content);
  place.append(section("diagnosis", "Diagnosis", panel, figures));

  /** Read the newest report where there is another than last time. */
  async function poll() {
    const page = await read(`${path}?limit=1`);
    if (due || page.changed) {
      due = true; // after an error midway too
      const [newest] = page.body.items;
      draw(newest ? await report(newest.diagnosis_id) : null);
      due = false;
    }
    if (latest?.status === "running") await showHowFar(latest);
  }

  /** @param {DiagnosisOut} running */
  async function showHowFar({ diagnosis_id: id, created_at: since }) {
    const { body } = await read(`/v1/jobs/${encodeURIComponent(id)}`);
    const { step, done, of } = body.progress ?? { step: "waiting for its turn", done: null, of: null };
    const count = of ? `, ${done ?? 0} of ${of}` : "";
    computing(content, `the diagnosis (${step}${count})`, Date.parse(since));
  }

  /** @param {string} id */
  const report = async (id) => (await read(`${path}/${encodeURIComponent(id)}`)).body;

  /** @param {DiagnosisOut | null} found */
  function draw(found) {
    latest = found;
    if (latest === null || latest.status === "running") {
      if (latest === null) content.replaceChildren(quiet(NEVER_RUN));
      else computing(content, "the diagnosis", Date.parse(latest.created_at));
      figures.hidden = true;
      return;
    }
    run.textContent = "Run it again";
    run.className = "";
    content.replaceChildren(...reportView(latest), actions(latest));
    for (const { chart, spec } of drawings) {
      const shown = spec(latest);
      chart.element.hidden = shown === null;
      if (shown !== null) chart.show(shown);
    }
    figures.hidden = drawings.every(({ chart }) => chart.element.hidden);
  }

  /** @param {DiagnosisOut} shown */
  function actions(shown) {
    const { adopted, adoptable, causes } = shown;
    const extended = (model?.effects.length ?? 0) > 0;
    return h(
      "div.row.buttons.adopt",
      adopted && quiet("This diagnosis is adopted: tracking and remaining life use the extended model."),
      !adopted &&
        adoptable &&
        button(
          causes.length > 0 ? "Adopt the extended model" : "Adopt the friction curve as found",
          () => adopt(shown),
          { class: "main" },
        ),
      (extended || adopted) && button("Go back to the baseline", () => goBack(shown)),
    );
  }

  function start() {
    return doing("The diagnosis runs; this takes seconds to minutes …", async () => {
      const { status, body, location } = await send("POST", path, { adopt: false }, { Prefer: "wait=20" });
      draw(status === 202 ? await finished(location ?? `${path}/${body.diagnosis_id}`) : body);
    });
  }

  /** @param {DiagnosisOut} shown */
  async function adopt(shown) {
    const { gain, diagnosis_id: id } = shown;
    const names = namesOf([...shown.causes, ...(shown.friction_law?.adoptable ? ["friction_law"] : [])]);
    const sure = await agreed({
      title: `Adopt ${names}?`,
      action: "Adopt it",
      points: [
        `The clutch will be tracked with the extended model (${names}), and every answer will name this model.`,
        "All its predictions, the past ones too, are recomputed from the stored runs.",
        "The runs themselves are not touched, and you can go back to the baseline at any time.",
      ],
      more: nowAndThen(gain?.remaining_useful_life),
    });
    if (sure) await put(id, "Adopting: the predictions are recomputed …", "Adopted.");
  }

  /** @param {DiagnosisOut} shown */
  async function goBack({ gain }) {
    const life = gain?.remaining_useful_life;
    const sure = await agreed({
      title: "Go back to the baseline?",
      action: "Go back",
      points: [
        `Tracking and remaining life will no longer account for ${namesOf(model?.effects)}.`,
        "All predictions are recomputed with the baseline. The runs and the report stay.",
      ],
      more: nowAndThen(life && { before: life.after, after: life.before }),
    });
    if (sure) await put(null, "Going back: the predictions are recomputed …", "The baseline is used again.");
  }

  /** @type {(id: string | null, under: string, done: string) => Promise<void>} of a diagnosis; null: the baseline */
  const put = (id, under, done) =>
    doing(
      under,
      async () => {
        await send("PUT", `${reader.path}/model`, { diagnosis_id: id });
        await changed();
        if (latest) draw(await report(latest.diagnosis_id));
      },
      done,
    );

  /** @type {(under: string, work: () => Promise<void>, done?: string) => Promise<void>} said meanwhile, and at the end */
  function doing(under, work, done = "") {
    const ended = async () => {
      await work();
      answer.replaceChildren(done && quiet(done));
    };
    return attempted([...content.querySelectorAll("button"), run], answer, under, ended, "Nothing was changed. ");
  }

  return {
    poll,
    show: async () => {
      const before = JSON.stringify(model);
      if (reader.present().runs > 0) ({ model } = await reader.life());
      if (JSON.stringify(model) !== before) draw(latest);
      await poll();
    },
  };
}

/** @type {(path: string) => Promise<DiagnosisOut>} */
async function finished(path) {
  for (;;) {
    await new Promise((resolve) => setTimeout(resolve, 1000));
    /** @type {{ body: DiagnosisOut }} */
    const { body } = await read(path);
    if (body.status !== "running") return body;
  }
}

/** @param {string[] | undefined} effects */
const namesOf = (effects) => (effects ?? []).map(words).join(", ") || "the extension";
