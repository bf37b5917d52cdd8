// The charts: answers of the API go in, figures with a title, a table and files come out. Open this file first (one chart),
// then life.js: like fan.js, loops.js, parameters.js and stribeck.js it says what its charts show; the others say how a chart
// is placed (frame.js), drawn (draw.js), read and zoomed (reading.js) and saved (picture.js).

import { button, h, markShown, quiet, saveBlob, scrolling, select, symbol, table, watch } from "../shared/dom.js";
import { saveTable } from "../shared/files.js";
import { draw } from "./draw.js";
import { framed } from "./frame.js";
import { colours } from "./palette.js";
import { pngOf, svgOf } from "./picture.js";
import { reading } from "./reading.js";

/** @typedef {{ id: string, title: string, wide?: boolean, height?: number, letter?: [string, string] | null }} Options height: px; letter: with its index */

const MOST_ROWS = 400;
const HELP = "Arrow keys read its values, + and − zoom, Escape shows all. The numbers are in the table below.";
/** Of saved files, px. */
const SAVED = { width: 1000, height: 600 };

export class Chart {
  /** @param {Options} options */
  constructor({ id, title, letter = null, wide = false, height = 360 }) {
    this.id = id;
    this.title = title;
    this.height = height;
    /** @type {Spec | null} */
    this.spec = null;
    this.stale = false;
    this.visible = false;
    /** @type {Framed | null} */
    this.framed = null;
    /** @type {Colours | null} */
    this.colours = null;
    /** @type {Zoom[]} */
    this.zooms = [];
    this.axes = "";
    this.note = h("p.note", "Reading what it shows …");
    this.controls = h("div.row.controls");
    this.plot = h("div.plot", { role: "application", style: { "min-height": `${height}px` } });
    this.forget = reading(this.plot, this);
    this.table = scrolling(`${title}: table`);
    this.details = h("details", { ontoggle: () => this.fill() }, h("summary", "Table"), this.table);
    this.whole = this.button("Show all", "show all of it", () => this.showAll());
    this.whole.hidden = true;
    this.tools = h(
      "div.tools",
      this.whole,
      this.button("PNG", "save as PNG", async () => saveBlob(this.file("png"), await pngOf(this.light(SAVED), 2))),
      this.button("SVG", "save as SVG", () => saveBlob(this.file("svg"), svgOf(this.light(SAVED)))),
      this.button("CSV", "save data as CSV", () => this.saveTable("csv")),
      this.button("XLSX", "save data as XLSX", () => this.saveTable("xlsx")),
    );
    const heading = h("h3", title, letter && [" ", symbol(...letter)]);
    this.element = h(
      "figure",
      { class: `chart panel${wide ? " wide" : ""}`, id: `chart-${id}` },
      h("figcaption", heading, this.tools, this.note),
      this.controls,
      this.plot,
      this.details,
    );
    watch(this.element, 400, (near) => this.near(near));
    new ResizeObserver(() => this.resized()).observe(this.plot);
    document.addEventListener("themechange", () => this.redraw());
  }

  /** @type {(text: string, action: string, onclick: () => unknown) => HTMLButtonElement} */
  button(text, action, onclick) {
    return button(text, onclick, { class: "small", "aria-label": `${this.title}: ${action}` });
  }

  /** @param {Spec} spec what to show from now on */
  show(spec) {
    this.spec = spec;
    this.note.textContent = spec.note ?? "";
    const nothing = spec.empty !== undefined;
    this.element.classList.toggle("empty", nothing);
    if (nothing) {
      delete this.element.dataset.drawn;
      this.framed = null;
      this.plot.replaceChildren(h("p.nothing", spec.empty));
    }
    this.plot.tabIndex = nothing ? -1 : 0;
    this.plot.setAttribute("aria-label", nothing ? this.title : `${this.title}. ${spec.note} ${HELP}`);
    this.tools.hidden = this.details.hidden = !spec.rows?.length;
    if (this.details.open) this.fill();
    this.redraw();
  }

  /** @param {boolean} visible whether the chart is on the screen or close to it */
  near(visible) {
    this.visible = visible;
    if (visible && this.stale) this.draw();
  }

  redraw() {
    this.stale = this.spec?.figure !== undefined;
    if (this.visible && this.stale) this.draw();
  }

  /** In the colours of now; not while there is no room, as in a hidden tab: then when it is next looked at. */
  draw() {
    const width = this.plot.clientWidth;
    if (!this.spec?.figure || width <= 0) return;
    this.stale = false;
    this.colours = colours();
    const figure = this.spec.figure(this.colours);
    const axes = figure.map(({ x, y }) => `${x.title} ${y.title}`).join();
    if (axes !== this.axes) this.zooms = []; // another quantity
    this.axes = axes;
    this.framed = framed(figure, { width, height: this.height }, this.zooms);
    this.whole.hidden = this.zooms.length === 0;
    this.forget();
    this.plot.querySelector(".drawing, .nothing")?.remove();
    this.plot.style.minHeight = `${this.framed.size.height}px`;
    this.plot.prepend(draw(this.framed, this.colours, { class: "drawing", "aria-hidden": "true" }));
    if (!this.element.dataset.drawn) markShown(`drawn ${this.id}`);
    this.element.dataset.drawn = "yes";
  }

  resized() {
    if (this.framed && this.plot.clientWidth !== this.framed.size.width) this.redraw();
  }

  fill() {
    if (!this.details.open || !this.spec?.rows) return;
    const { columns, rows } = this.spec;
    const names = columns.map(({ name }) => name);
    const cells = rows.slice(0, MOST_ROWS).map((row) => row.map((value, index) => cellText(value, columns[index])));
    const cut = `The first ${cells.length} of ${rows.length} rows; the CSV holds all.`;
    this.table.replaceChildren(table(this.title, names, cells), rows.length > cells.length ? quiet(cut) : "");
  }

  /** @type {(size: Size) => SVGSVGElement} the drawing in the light scheme, for paper, as it is zoomed */
  light(size) {
    const c = colours("light");
    return draw(framed(this.spec?.figure?.(c) ?? [], size, this.zooms), c, {
      class: "drawing",
      role: "img",
      "aria-label": this.title,
    });
  }

  showAll() {
    this.zooms = [];
    this.redraw();
  }

  /** @param {"csv" | "xlsx"} format */
  saveTable(format) {
    if (!this.spec?.rows) return;
    const { columns, rows } = this.spec;
    saveTable(this.file(format), [columns.map(({ name }) => name), ...rows]);
  }

  /** @param {string} ending of a saved file's name, which says what page the chart is of */
  file(ending) {
    const [page] = document.title.split(" · ");
    return `${page}-${this.id}.${ending}`.replaceAll(/[^\w.-]+/g, "_");
  }
}

/** @type {(...charts: Chart[]) => HTMLElement} beside each other */
export const chartsOf = (...charts) => h("div.charts", ...charts.map(({ element }) => element));

/** @type {(value: Cell, column: Column) => string} */
function cellText(value, { text }) {
  if (value === null || value === undefined) return "–";
  return text && typeof value === "number" ? text(value) : String(value);
}

/**
 * A labelled choice for a chart's controls: of values, each with its text.
 * @template {string | number} Value
 * @param {string} label
 * @param {[Value, string][]} options
 * @param {Value | undefined} value
 * @param {(value: Value) => unknown} changed
 */
export function choice(label, options, value, changed) {
  const list = select({ onchange: () => changed(options[list.selectedIndex][0]) }, options, value);
  return h("label", `${label} `, list);
}

/**
 * Choices that are kept by name: what is chosen is noted, and `changed` draws it.
 * @template {object} Chosen
 * @param {Chosen} chosen
 * @param {(name: keyof Chosen) => unknown} changed
 */
export function chooser(chosen, changed) {
  /**
   * @template {keyof Chosen} Name
   * @param {Name} name
   * @param {string} label
   * @param {[NonNullable<Chosen[Name]> & (string | number), string][]} options
   * @param {Chosen[Name]} value
   */
  return (name, label, options, value = chosen[name]) =>
    choice(label, options, /** @type {any} */ (value), (now) => {
      chosen[name] = now;
      changed(name);
    });
}

/** @type {(chart: { controls: HTMLElement }, controls: HTMLElement[]) => void} the focus stays where it was */
export function setControls(chart, controls) {
  const focused = [...chart.controls.querySelectorAll("select")].findIndex(
    (select) => select === document.activeElement,
  );
  chart.controls.replaceChildren(...controls);
  if (focused >= 0) chart.controls.querySelectorAll("select")[focused]?.focus();
}
