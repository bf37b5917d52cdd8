// One chart: its title, its drawing, its table, its PNG and its CSV. Until the plotting library is there, and where it does
// not load, the drawing is a light one.

import { h, save, saveText, symbol } from "./dom.js";
import { settled } from "./frame.js";
import { base, config } from "./layout.js";
import { colours } from "./palette.js";
import { has3d, painted, plotly } from "./plotting.js";
import { sketch } from "./sketch.js";

const MOST_ROWS = 400;
const seen = new IntersectionObserver((entries) => { for (const { target, isIntersecting } of entries) target.chart.near(isIntersecting); }, { rootMargin: "400px" });

export class Chart {
  /** `spatial` charts need WebGL; `name` is the start of saved files' names. */
  constructor({ id, title, name, letter = null, spatial = false, wide = false, height = 360 }) {
    Object.assign(this, { id, title, name, spatial, height, spec: null, stale: false, visible: false, turn: 0 });
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
    this.redraw();
  }

  near(visible) {
    this.visible = visible;
    if (visible && this.stale) this.draw();
  }

  redraw() {
    this.stale = this.spec !== null && !this.element.classList.contains("empty");
    if (this.visible && this.stale) this.draw();
  }

  async draw() {
    this.stale = false;
    this.turn += 1;
    const { turn } = this;
    if (!this.element.dataset.drawn) this.sketch();
    let Plotly;
    try {
      Plotly = await plotly();
    } catch {
      this.stale = true; // tried again when the chart is next looked at
      if (!this.plot.hasChildNodes()) this.plot.append(h("p", { class: "nothing" }, "The plotting library did not load. The table holds the numbers."));
      return;
    }
    if (turn !== this.turn || this.element.classList.contains("empty")) return;
    const { data, layout } = this.figure();
    await Plotly.react(this.plot, data, layout, config(this.spatial));
    this.plot.querySelector(".sketch, .nothing")?.remove();
    this.element.dataset.drawn = "yes";
    performance.mark(`drawn ${this.id}`);
  }

  /** Data and layout in the colours of now. */
  figure(scheme = null, { width = this.plot.clientWidth, height = this.height, compact = width < 480 } = {}) {
    const c = colours(scheme);
    const { data, layout } = this.spec.figure(c);
    const whole = { data, layout: base(c, layout, { height, compact, spatial: this.spatial }) };
    return settled(whole, { width, height }) ?? whole;
  }

  /** What can be drawn without the library is drawn at once. */
  sketch() {
    const figure = this.figure();
    if (!figure.ticks) return;
    this.plot.querySelector(".sketch, .nothing")?.remove();
    this.plot.append(sketch(figure, { width: this.plot.clientWidth, height: this.height }));
    this.element.dataset.sketched = "yes";
    painted().then(() => performance.mark(`sketched ${this.id}`));
  }

  clear() {
    this.turn += 1;
    if (this.element.dataset.drawn) globalThis.Plotly?.purge(this.plot);
    delete this.element.dataset.drawn;
    delete this.element.dataset.sketched;
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

  /** The light drawing as an image's address, in any size and scheme; null where there is none. */
  light({ width, height, scheme = null }) {
    if (this.spec === null || this.element.classList.contains("empty")) return null;
    const figure = this.figure(scheme, { width, height, compact: false });
    return figure.ticks ? `data:image/svg+xml,${encodeURIComponent(new XMLSerializer().serializeToString(sketch(figure, { width, height })))}` : null;
  }

  async savePng() {
    const Plotly = await plotly();
    const [width, height] = [1000, 600];
    if (this.spatial && !this.element.dataset.drawn) await this.draw();
    const { data, layout } = this.figure(null, { width, height, compact: false });
    // a chart in 3D is saved as it has been turned
    const shown = this.spatial ? this.plot : { data, layout: { ...layout, width } };
    save(`${this.name()}-${this.id}.png`, await Plotly.toImage(shown, { format: "png", width, height, scale: 2 }));
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
