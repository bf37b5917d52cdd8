// One chart: its title, its drawing, its table, its PNG and its CSV.

import { h, save, saveText, symbol } from "./dom.js";
import { base, config } from "./layout.js";
import { colours } from "./palette.js";
import { has3d, plotly } from "./plotting.js";

const MOST_ROWS = 400;
const seen = new IntersectionObserver((entries) => { for (const { target, isIntersecting } of entries) target.chart.near(isIntersecting); }, { rootMargin: "400px" });

export class Chart {
  /** `spatial` charts need WebGL; `name` is the start of saved files' names. */
  constructor({ id, title, name, letter = null, spatial = false, wide = false, height = 360 }) {
    Object.assign(this, { id, title, name, spatial, height, spec: null, stale: false, visible: false });
    this.note = h("p", { class: "note" });
    this.controls = h("div", { class: "controls" });
    this.plot = h("div", { class: "plot", role: "img", "aria-label": title, style: { "min-height": `${height}px` } });
    this.table = h("div", { class: "scroll", tabindex: "0", role: "group", "aria-label": `${title}: table` });
    this.details = h("details", { ontoggle: () => this.fill() }, h("summary", {}, "Table"), this.table);
    this.tools = h("div", { class: "tools" },
      h("button", { type: "button", class: "small", onclick: () => this.savePng(), "aria-label": `${title}: save as PNG` }, "PNG"),
      h("button", { type: "button", class: "small", onclick: () => this.saveCsv(), "aria-label": `${title}: save data as CSV` }, "CSV"));
    this.element = h("figure", { class: `chart panel${wide ? " wide" : ""}`, id: `chart-${id}` },
      h("figcaption", {}, h("h3", {}, title, letter && [" ", symbol(...letter)]), this.tools, this.note), this.controls, this.plot, this.details);
    this.element.chart = this;
    seen.observe(this.element);
    document.addEventListener("themechange", () => this.redraw());
  }

  /**
   * What to show: `note` (a sentence that says what is seen), `columns` [{name, text}] and `rows` of raw values, and
   * `figure(colours)` giving Plotly's data and layout; or `empty`, what is missing and how to get it.
   */
  show(spec) {
    this.spec = spec;
    this.note.textContent = spec.note ?? "";
    const nothing = spec.empty ?? (this.spatial && !has3d() ? "This browser does not draw in 3D (WebGL is off). The table holds the numbers." : null);
    this.element.classList.toggle("empty", nothing !== null);
    if (nothing !== null) {
      this.clear();
      this.plot.replaceChildren(h("p", { class: "nothing" }, nothing));
    } else if (this.plot.querySelector(".nothing")) this.plot.replaceChildren();
    this.plot.setAttribute("aria-label", `${this.title}. ${spec.note ?? ""} The numbers are in the table below.`);
    const bare = !spec.rows?.length;
    this.tools.hidden = this.details.hidden = bare;
    if (this.details.open) this.fill();
    return this.redraw();
  }

  near(visible) {
    this.visible = visible;
    if (visible && this.stale) this.draw();
  }

  redraw() {
    this.stale = this.spec !== null && !this.element.classList.contains("empty");
    return this.visible && this.stale ? this.draw() : null;
  }

  async draw() {
    this.stale = false;
    const Plotly = await plotly();
    if (this.element.classList.contains("empty")) return;
    const c = colours();
    const { data, layout } = this.spec.figure(c);
    const compact = this.plot.clientWidth < 480;
    await Plotly.react(this.plot, data, base(c, layout, { height: this.height, compact, spatial: this.spatial }), config(this.spatial));
    this.element.dataset.drawn = "yes";
    performance.mark(`drawn ${this.id}`);
  }

  clear() {
    if (this.element.dataset.drawn) globalThis.Plotly?.purge(this.plot);
    delete this.element.dataset.drawn;
  }

  fill() {
    if (!this.details.open || !this.spec?.rows) return;
    const { columns, rows } = this.spec;
    const shown = rows.slice(0, MOST_ROWS);
    this.table.replaceChildren(
      h("table", {}, h("caption", { class: "hidden" }, this.title),
        h("thead", {}, h("tr", {}, columns.map(({ name }) => h("th", { scope: "col" }, name)))),
        h("tbody", {}, shown.map((row) => h("tr", {}, row.map((value, index) => h("td", {}, said(value, columns[index]))))))),
      rows.length > shown.length ? h("p", { class: "quiet" }, `The first ${shown.length} of ${rows.length} rows; the CSV holds all.`) : "");
  }

  /** The chart as an image's address, in any size and scheme; null where there is nothing to draw. */
  async image(format, { width, height, scheme = null, scale = 1 }) {
    if (this.spec === null || this.element.classList.contains("empty")) return null;
    const Plotly = await plotly();
    if (this.spatial) {
      await this.draw();
      return Plotly.toImage(this.plot, { format, width, height, scale });
    }
    const c = colours(scheme);
    const { data, layout } = this.spec.figure(c);
    return Plotly.toImage({ data, layout: { ...base(c, layout, { height, compact: false, spatial: false }), width, height } }, { format, width, height, scale });
  }

  async savePng() {
    const address = await this.image("png", { width: 1000, height: 600, scale: 2 });
    if (address) save(`${this.name()}-${this.id}.png`, address);
  }

  saveCsv() {
    const { columns, rows } = this.spec;
    const lines = [columns.map(({ name }) => name), ...rows].map((row) => row.map(quoted).join(","));
    saveText(`${this.name()}-${this.id}.csv`, `${lines.join("\r\n")}\r\n`, "text/csv");
  }
}

const said = (value, { text }) => (value === null || value === undefined ? "–" : text ? text(value) : String(value));

/** A field after RFC 4180; a name that a spreadsheet would run as a formula is kept from it. */
function quoted(value) {
  if (value === null || value === undefined) return "";
  const text = typeof value === "string" && /^[=+\-@\t\r]/.test(value) ? `'${value}` : String(value);
  return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}

/** A labelled choice for a chart's controls. */
export function choice(label, options, value, chosen) {
  const select = h("select", { onchange: () => chosen(select.value) }, options.map(([key, text]) => h("option", { value: key, selected: String(key) === String(value) }, text)));
  return h("label", {}, `${label} `, select);
}
