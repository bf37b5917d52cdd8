// @ts-check
// The diagnosis: reports of the API go in; verdict, tables, charts and the buttons to run and adopt it come out.
// Open this file first, then report.js (a report in words and tables) and charts.js (residuals and loops, before and after);
// before the model changes, lifebars.js shows what the change means.

import { clutchPath, read, sendJson } from "../shared/api.js";
import { agreed } from "../shared/dialog.js";
import { button, h, quiet } from "../shared/dom.js";
import { words } from "../shared/format.js";
import { problemView } from "../shared/problem_view.js";
import { charts } from "./charts.js";
import { lifeBars } from "./lifebars.js";
import { report } from "./report.js";

/** @import { BeforeAndAfter, DiagnosisListed, DiagnosisOut, ListPage, ModelName } from "../shared/types.js" */

const QUESTION =
  "Do the data and the model disagree beyond noise and run-to-run scatter? If so: where, and which physical cause accounts for it?";
const NEVER_RUN = "No diagnosis has been run yet. It reads the stored runs and changes nothing.";

/** @param {BeforeAndAfter | null | undefined} life remaining life under both models */
const nowAndThen = (life) => life && lifeBars(life, ["Now", "Then"]);

export class Diagnosis {
  /**
   * @param {HTMLElement} place the section's body
   * @param {string} clutchId
   * @param {() => string} name the start of saved files' names
   * @param {() => Promise<void>} changed hears that the clutch's model is another now
   */
  constructor(place, clutchId, name, changed) {
    this.clutch = clutchPath(clutchId);
    this.path = `${this.clutch}/diagnoses`;
    this.changed = changed;
    /** @type {DiagnosisOut | null} */
    this.latest = null;
    /** @type {ModelName | null} */
    this.model = null;
    this.due = true;
    this.run = button("Run the diagnosis", () => this.start(), { class: "main" });
    this.status = h("span", { class: "quiet", role: "status" });
    this.wrong = h("div");
    this.content = h("div");
    this.charts = charts(name);
    const figures = this.charts.map(({ chart }) => chart.element);
    this.maps = h("div", { class: "charts", hidden: true }, figures);
    const buttons = h("div", { class: "buttons start" }, this.run, this.status);
    const question = h("p", { class: "question" }, QUESTION);
    place.append(h("div", { class: "panel diagnosis" }, question, buttons, this.wrong, this.content), this.maps);
  }

  /** Read the newest report where there is another than last time. */
  async poll() {
    /** @type {{ body: ListPage<DiagnosisListed>, changed: boolean }} */
    const page = await read(`${this.path}?limit=1`);
    this.due ||= page.changed;
    if (!this.due) return;
    const [newest] = page.body.items;
    this.show(newest ? await this.read(newest.diagnosis_id) : null);
    this.due = false;
  }

  /** @type {(id: string) => Promise<DiagnosisOut>} */
  async read(id) {
    return (await read(`${this.path}/${encodeURIComponent(id)}`)).body;
  }

  /** @param {ModelName} model under which the clutch is tracked now */
  setModel(model) {
    const before = JSON.stringify(this.model);
    this.model = model;
    if (JSON.stringify(model) !== before) this.draw();
  }

  /** @param {DiagnosisOut | null} latest */
  show(latest) {
    this.latest = latest;
    this.draw();
  }

  draw() {
    const { latest } = this;
    if (latest === null || latest.status === "running") {
      const never = latest === null;
      const text = never ? NEVER_RUN : "A diagnosis is under way …";
      this.content.replaceChildren(h("p", { class: never ? "quiet" : null }, text));
      this.maps.hidden = true;
      return;
    }
    this.run.textContent = "Run it again";
    this.run.className = "";
    this.content.replaceChildren(...report(latest), this.actions(latest));
    for (const { chart, spec } of this.charts) {
      const content = spec(latest);
      chart.element.hidden = content === null;
      if (content !== null) chart.show(content);
    }
    this.maps.hidden = this.charts.every(({ chart }) => chart.element.hidden);
  }

  /** @param {DiagnosisOut} latest */
  actions({ adopted, adoptable }) {
    const extended = (this.model?.effects.length ?? 0) > 0;
    const note = "This diagnosis is adopted: tracking and remaining life use the extended model.";
    const adopt = { type: "button", class: "main", onclick: () => this.adopt() };
    const goBack = { type: "button", onclick: () => this.goBack() };
    return h(
      "div",
      { class: "buttons adopt" },
      adopted && quiet(note),
      !adopted && adoptable && h("button", adopt, "Adopt the extended model"),
      (extended || adopted) && h("button", goBack, "Go back to the baseline"),
    );
  }

  async start() {
    await this.doing("The diagnosis runs; this takes seconds to minutes …", async () => {
      /** @type {{ status: number, body: DiagnosisOut, location: string | null }} */
      const answer = await sendJson("POST", this.path, { adopt: false }, { Prefer: "wait=20" });
      const { status, body, location } = answer;
      this.show(status === 202 ? await this.finished(location ?? `${this.path}/${body.diagnosis_id}`) : body);
    });
  }

  /** @type {(path: string) => Promise<DiagnosisOut>} */
  async finished(path) {
    for (;;) {
      await new Promise((resolve) => {
        setTimeout(resolve, 1000);
      });
      /** @type {{ body: DiagnosisOut }} */
      const { body } = await read(path);
      if (body.status !== "running") return body;
    }
  }

  async adopt() {
    const { latest } = this;
    if (latest === null) return;
    const names = namesOf(latest.causes);
    const sure = await agreed({
      title: `Adopt ${names}?`,
      action: "Adopt it",
      points: [
        `The clutch will be tracked with the extended model (${names}), and every answer will name this model.`,
        "All its predictions, the past ones too, are recomputed from the stored runs.",
        "The runs themselves are not touched, and you can go back to the baseline at any time.",
      ],
      more: nowAndThen(latest.gain?.remaining_useful_life),
    });
    if (sure) await this.put(latest.diagnosis_id, "Adopting: the predictions are recomputed …");
  }

  async goBack() {
    const life = this.latest?.gain?.remaining_useful_life;
    const sure = await agreed({
      title: "Go back to the baseline?",
      action: "Go back",
      points: [
        `Tracking and remaining life will no longer account for ${namesOf(this.model?.effects)}.`,
        "All predictions are recomputed with the baseline. The runs and the report stay.",
      ],
      more: nowAndThen(life && { before: life.after, after: life.before }),
    });
    if (sure) await this.put(null, "Going back: the predictions are recomputed …");
  }

  /**
   * @param {string | null} id of the diagnosis whose model is to be used; null is the baseline
   * @param {string} status
   */
  async put(id, status) {
    const done = await this.doing(status, async () => {
      await sendJson("PUT", `${this.clutch}/model`, { diagnosis_id: id });
      await this.changed();
      if (this.latest) this.show(await this.read(this.latest.diagnosis_id));
    });
    if (done) this.status.textContent = id === null ? "The baseline is used again." : "Adopted.";
  }

  /** @type {(status: string, work: () => Promise<void>) => Promise<boolean>} whether it went well */
  async doing(status, work) {
    const buttons = [...this.content.querySelectorAll("button"), this.run];
    for (const button of buttons) button.disabled = true;
    this.status.textContent = status;
    this.wrong.replaceChildren();
    try {
      await work();
      return true;
    } catch (problem) {
      this.wrong.replaceChildren(problemView(problem, "Nothing was changed. "));
      return false;
    } finally {
      this.status.textContent = "";
      for (const button of buttons) button.disabled = false;
    }
  }
}

/** @param {string[] | undefined} effects */
const namesOf = (effects) => (effects ?? []).map(words).join(", ") || "the extension";
