// The diagnosis: run it, read it, adopt it, go back.

import { clutchPath, Problem, read, sendJson } from "./api.js";
import { confirm } from "./confirm.js";
import { h } from "./dom.js";
import { words } from "./format.js";
import { charts } from "./diagnosis_charts.js";
import { report } from "./diagnosis_report.js";
import { wrongView } from "./receipt.js";

const QUESTION = "Do the data and the model disagree beyond noise and run-to-run scatter? If so: where, and which physical cause accounts for it?";

export class Diagnosis {
  /** `place` is the section's body, `changed()` hears that the clutch's model is another now. */
  constructor(place, clutchId, name, changed) {
    Object.assign(this, { clutchId, changed, path: `${clutchPath(clutchId)}/diagnoses`, latest: null, model: null, due: true });
    this.run = h("button", { type: "button", class: "main", onclick: () => this.start() }, "Run the diagnosis");
    this.status = h("span", { class: "quiet", role: "status" });
    this.wrong = h("div");
    this.content = h("div");
    this.charts = charts(name);
    this.maps = h("div", { class: "charts" }, this.charts.map(({ chart }) => chart.element));
    place.append(
      h("div", { class: "panel diagnosis" }, h("p", { class: "question" }, QUESTION), h("div", { class: "buttons start" }, this.run, this.status), this.wrong, this.content),
      this.maps);
    this.maps.hidden = true;
  }

  /** Ask for the latest report. */
  async look() {
    const found = await read(`${this.path}?limit=1`);
    this.due ||= found.changed;
    if (!this.due) return;
    const [newest] = found.body.items;
    if (newest) this.show((await read(`${this.path}/${encodeURIComponent(newest.diagnosis_id)}`)).body);
    else this.show(null);
    this.due = false;
  }

  /** What the clutch is tracked under now: `{name, effects}`. */
  setModel(model) {
    const before = JSON.stringify(this.model);
    this.model = model;
    if (JSON.stringify(model) !== before) this.draw();
  }

  show(found) {
    this.latest = found;
    this.draw();
  }

  draw() {
    const { latest } = this;
    if (latest === null || latest.status === "running") {
      this.content.replaceChildren(latest === null ? h("p", { class: "quiet" }, "No diagnosis has been run yet. It reads the stored runs and changes nothing.") : h("p", {}, "A diagnosis is under way …"));
      this.maps.hidden = true;
      return;
    }
    this.run.textContent = "Run it again";
    this.run.className = "";
    this.content.replaceChildren(...report(latest), this.actions());
    const any = this.charts.map(({ chart, spec }) => { const found = spec(latest); chart.element.hidden = found === null; if (found) chart.show(found); return found !== null; });
    this.maps.hidden = !any.includes(true);
  }

  actions() {
    const extended = (this.model?.effects.length ?? 0) > 0;
    const { adopted } = this.latest;
    const { adoptable } = this.latest;
    return h("div", { class: "buttons adopt" },
      adopted ? h("p", { class: "quiet" }, "This diagnosis is adopted: tracking and remaining life use the extended model.") : null,
      !adopted && adoptable ? h("button", { type: "button", class: "main", onclick: () => this.adopt() }, "Adopt the extended model") : null,
      extended || adopted ? h("button", { type: "button", onclick: () => this.goBack() }, "Go back to the baseline") : null);
  }

  async start() {
    await this.doing("The diagnosis runs; this takes seconds to minutes …", async () => {
      const { status, body, location } = await sendJson("POST", this.path, { adopt: false }, { Prefer: "wait=20" });
      this.show(status === 202 ? await this.finished(location ?? `${this.path}/${body.diagnosis_id}`) : body);
    });
  }

  async finished(path) {
    for (;;) {
      await new Promise((later) => { setTimeout(later, 1000); });
      const { body } = await read(path);
      if (body.status !== "running") return body;
    }
  }

  async adopt() {
    if (await confirm(this.adoption())) await this.put(this.latest.diagnosis_id, "Adopting: the clutch is tracked anew …");
  }

  adoption() {
    const names = (this.latest.causes ?? []).map(words).join(", ") || "the extension";
    return { title: `Adopt ${names}?`, action: "Adopt it", points: [
      `The clutch will be tracked under the extended model (${names}); every answer will name it.`,
      "All its predictions, the past ones too, are computed anew from the stored runs.",
      "The runs themselves are not touched, and you can go back to the baseline at any time."], life: this.latest.gain?.remaining_useful_life ?? null };
  }

  async goBack() {
    const names = (this.model?.effects ?? []).map(words).join(", ") || "the extension";
    const life = this.latest?.gain?.remaining_useful_life;
    const agreed = await confirm({ title: "Go back to the baseline?", action: "Go back", points: [
      `Tracking and remaining life will no longer account for ${names}.`,
      "All predictions are computed anew under the baseline. The runs and the report stay."], life: life ? { before: life.after, after: life.before } : null });
    if (agreed) await this.put(null, "Going back: the clutch is tracked anew …");
  }

  async put(diagnosisId, said) {
    const done = await this.doing(said, async () => {
      await sendJson("PUT", `${clutchPath(this.clutchId)}/model`, { diagnosis_id: diagnosisId });
      await this.changed();
      if (this.latest) this.show((await read(`${this.path}/${encodeURIComponent(this.latest.diagnosis_id)}`)).body);
    });
    if (done) this.status.textContent = diagnosisId === null ? "The baseline is used again." : "Adopted.";
  }

  /** Work that the reader waits for; resolves to whether it went well. */
  async doing(said, work) {
    const buttons = [...this.content.querySelectorAll("button"), this.run];
    for (const button of buttons) button.disabled = true;
    this.status.textContent = said;
    this.wrong.replaceChildren();
    try {
      await work();
      this.status.textContent = "";
      return true;
    } catch (problem) {
      this.status.textContent = "";
      if (!(problem instanceof Problem)) throw problem;
      this.wrong.replaceChildren(wrongView(problem, "Nothing was changed. "));
      return false;
    } finally {
      for (const button of buttons) button.disabled = false;
    }
  }
}
