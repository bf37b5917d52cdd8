// A run sent from the page: a file dropped or chosen, what the service must know of it, its receipt or what is wrong.

import { clutchPath, read, send, sendJson } from "./api.js";
import { h } from "./dom.js";
import { kindName } from "./format.js";
import { receiptView, wrongView } from "./receipt.js";

const KINDS = ["stationary_stribeck", "dynamic_stribeck"];

/** Make a button and the whole page take files. `clutches()` are the known ids, `sent()` hears of a stored run. */
export function sender(button, { clutches, sent }) {
  const chooser = h("input", { type: "file", hidden: true, "aria-label": "Run file", onchange: () => take(chooser.files) });
  document.body.append(chooser);
  button.addEventListener("click", () => { chooser.value = ""; chooser.click(); });
  const take = (files) => { if (files.length > 0) new Sending(files[0], clutches(), sent).open(); };
  let depth = 0;
  const over = (event) => event.dataTransfer?.types.includes("Files");
  addEventListener("dragenter", (event) => { if (over(event)) { depth += 1; document.body.classList.add("dropping"); } });
  addEventListener("dragleave", () => { depth = Math.max(0, depth - 1); if (depth === 0) document.body.classList.remove("dropping"); });
  addEventListener("dragover", (event) => { if (over(event)) event.preventDefault(); });
  addEventListener("drop", (event) => {
    if (!over(event)) return;
    event.preventDefault();
    depth = 0;
    document.body.classList.remove("dropping");
    take(event.dataTransfer.files);
  });
}

class Sending {
  constructor(file, clutches, sent) {
    Object.assign(this, { file, clutches, sent });
    this.answer = h("div", { class: "answer", "aria-live": "polite" });
    this.dialog = h("dialog", { "aria-labelledby": "sending-title", onclose: () => this.dialog.remove() });
  }

  async open() {
    this.json = await jsonRun(this.file);
    const id = this.json?.clutch_id ?? this.clutches[0] ?? "";
    const options = this.clutches.map((each) => h("option", { value: each }));
    this.clutch = h("input", { id: "to", required: true, value: id, list: "known", autocomplete: "off", pattern: "[A-Za-z0-9][A-Za-z0-9._:@+\\-]{0,127}", title: "letters, digits and . _ : @ + -" });
    this.go = h("button", { class: "main" }, "Send");
    this.dialog.append(
      h("h2", { id: "sending-title" }, "Send a run"),
      h("p", {}, h("b", {}, this.file.name), ` · ${size(this.file.size)}`, this.json ? ` · ${kindName(this.json.kind)} at ${this.json.cycles} cycles` : ""),
      h("form", { onsubmit: (event) => { event.preventDefault(); this.post(); } },
        h("div", { class: "fields" },
          h("div", {}, h("label", { for: "to" }, "Clutch"), this.clutch, h("datalist", { id: "known" }, options)),
          this.json ? null : this.fileFields()),
        h("div", { class: "buttons" }, h("button", { type: "button", onclick: () => this.dialog.close() }, "Close"), this.go)),
      this.answer);
    document.body.append(this.dialog);
    this.dialog.showModal();
    (this.cycles && this.clutch.value ? this.cycles : this.clutch).focus();
  }

  fileFields() {
    this.kind = h("select", { id: "kind" }, KINDS.map((value) => h("option", { value, selected: guess(this.file.name) === value }, kindName(value))));
    this.cycles = h("input", { id: "cycles", type: "number", min: 0, step: "any", required: true, inputmode: "decimal" });
    this.map = h("input", { id: "map", placeholder: "torque_nm:Mz,speed_rpm:n", autocomplete: "off" });
    const field = (input, text) => h("div", {}, h("label", { for: input.id }, text), input);
    return [field(this.kind, "Kind of test"), field(this.cycles, "Duty cycles since new"), field(this.map, "Columns by name (only where they are not found)")];
  }

  async post() {
    const id = this.clutch.value.trim();
    this.go.disabled = true;
    this.answer.replaceChildren(h("p", { class: "quiet" }, "Sending …"));
    try {
      await register(id);
      const { body } = await (this.json ? sendJson("POST", `${clutchPath(id)}/runs`, this.run()) : send("POST", this.address(id), this.file, { "Content-Type": "application/octet-stream" }));
      this.answer.replaceChildren(await receiptView(body));
      this.sent(body);
    } catch (problem) {
      this.answer.replaceChildren(wrongView(problem));
    }
    this.go.disabled = false;
    this.answer.scrollIntoView({ block: "nearest" });
  }

  run() {
    const { clutch_id: _, ...run } = this.json;
    return run;
  }

  address(id) {
    const asked = new URLSearchParams({ kind: this.kind.value, cycles: this.cycles.value, filename: this.file.name.slice(-200) });
    if (this.map.value.trim()) asked.set("map", this.map.value.trim());
    return `${clutchPath(id)}/runs/file?${asked}`;
  }
}

/** A clutch that is not known yet is registered with the reference's values. */
async function register(id) {
  try {
    await read(clutchPath(id));
  } catch (problem) {
    if (problem.status !== 404) throw problem;
    await sendJson("POST", "/v1/clutches", { clutch_id: id });
  }
}

/** A run as the API takes it, or null where the file is something else. */
async function jsonRun(file) {
  if (file.size > 64 * 2 ** 20 || !/\.json$/i.test(file.name)) return null;
  try {
    const found = JSON.parse(await file.text());
    return typeof found?.kind === "string" ? found : null;
  } catch {
    return null;
  }
}

const guess = (name) => (/dyn|loop/i.test(name) ? "dynamic_stribeck" : "stationary_stribeck");
const size = (bytes) => (bytes < 1e6 ? `${Math.max(1, Math.round(bytes / 1e3))} kB` : `${(bytes / 1e6).toFixed(1)} MB`);
