// The charts: answers of the API go in, figures with a title, a table, a PNG and a CSV come out. Open this file first (one
// chart; until someone points at it, and where the plotting library does not load, its drawing is a light one), then life.js:
// like fan.js, loops.js, parameters.js and stribeck.js it says what its charts show; the others say how a chart is drawn.

import { button, h, quiet, save, scrolling, select, symbol, table, watch } from "../shared/dom.js";
import { saveTable } from "../shared/files.js";
import { settled } from "./frame.js";
import { base, config } from "./layout.js";
import { colours } from "./palette.js";
import { has3d, painted, plotly, want, wanted } from "./plotting.js";
import { sketch } from "./sketch.js";

/**
 * @typedef {object} Options
 * @property {string} id
 * @property {string} title
 * @property {() => string} name the start of saved files' names
 * @property {[string, string] | null} [letter] a symbol with its index, after the title
 * @property {boolean} [spatial] whether it is drawn in 3D, which needs WebGL
 * @property {boolean} [wide]
 * @property {number} [height] px
 */

const MOST_ROWS = 400;
const NO_WEBGL = "This browser does not draw in 3D (WebGL is off). The table holds the numbers.";
const NO_LIBRARY = "The plotting library did not load. The table holds the numbers.";

/** @param {PointerEvent} event of a finger, it may be about to scroll: a tap is a click */
const pointed = (event) => event.pointerType !== "touch" && want();

export class Chart {
  /** @param {Options} options */
  constructor({ id, title, name, letter = null, spatial = false, wide = false, height = 360 }) {
    this.id = id;
    this.title = title;
    this.name = name;
    this.spatial = spatial;
    this.height = height;
    /** @type {Spec | null} */
    this.spec = null;
    this.stale = false;
    this.visible = false;
    this.turn = 0;
    this.note = h("p.note", "Reading what it shows …");
    this.controls = h("div.row.controls");
    this.ask = button("Draw it (loads 1.4 MB once)", want, { class: "small", hidden: true });
    const style = { "min-height": `${height}px` };
    const watched = { onpointerenter: pointed, onclick: want };
    this.plot = h("div.plot", { role: "img", "aria-label": title, style, ...watched });
    this.table = scrolling(`${title}: table`);
    this.details = h("details", { ontoggle: () => this.fill() }, h("summary", "Table"), this.table);
    this.tools = h(
      "div.tools",
      this.button("PNG", "save as PNG", () => this.savePng()),
      this.button("CSV", "save data as CSV", () => this.saveTable("csv")),
      this.button("XLSX", "save data as XLSX", () => this.saveTable("xlsx")),
    );
    const heading = h("h3", title, letter && [" ", symbol(...letter)]);
    this.element = h(
      "figure",
      { class: `chart panel${wide ? " wide" : ""}`, id: `chart-${id}` },
      h("figcaption", heading, this.tools, this.note),
      this.controls,
      this.ask,
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
    const nothing = spec.empty ?? (this.spatial && !has3d() ? NO_WEBGL : null);
    this.element.classList.toggle("empty", nothing !== null);
    if (nothing !== null) {
      this.ask.hidden = true;
      this.clear();
      this.plot.replaceChildren(h("p.nothing", nothing));
    } else if (this.plot.querySelector(".nothing")) this.plot.replaceChildren();
    this.plot.setAttribute("aria-label", `${this.title}. ${spec.note ?? ""} The numbers are in the table below.`);
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
    this.stale = this.spec !== null && !this.element.classList.contains("empty");
    if (this.visible && this.stale) this.draw();
  }

  async draw() {
    this.stale = false;
    this.turn += 1;
    const { turn } = this;
    if (!this.element.dataset.drawn) this.sketch();
    await wanted;
    if (turn !== this.turn) return;
    let library;
    try {
      library = await plotly();
    } catch {
      this.stale = true; // tried again when the chart is next looked at
      if (!this.plot.hasChildNodes()) this.plot.append(h("p.nothing", NO_LIBRARY));
      return;
    }
    const figure = this.figure();
    if (turn !== this.turn) return;
    if (figure === null) {
      this.stale = true; // its tab was left meanwhile: drawn when it is next looked at
      return;
    }
    this.ask.hidden = true;
    await library.react(this.plot, figure.data, figure.layout, config(this.spatial));
    this.plot.querySelector(".sketch, .nothing")?.remove();
    this.element.dataset.drawn = "yes";
    performance.mark(`drawn ${this.id}`);
  }

  /**
   * Data and layout in the colours of now, or of a scheme; null where there is nothing to draw, or no room (a hidden tab).
   * @param {Scheme} [scheme]
   * @param {Partial<Size> & { compact?: boolean }} [size]
   * @returns {SettledFigure | (WholeFigure & { ticks?: undefined }) | null}
   */
  figure(scheme = null, { width = this.plot.clientWidth, height = this.height, compact = width < 480 } = {}) {
    if (!this.spec?.figure || this.element.classList.contains("empty") || width <= 0) return null;
    const c = colours(scheme);
    const { data, layout } = this.spec.figure(c);
    const whole = { data, layout: base(c, layout, { height, compact }) };
    return settled(whole, { width, height }) ?? whole;
  }

  /** What can be drawn without the library is drawn at once; for the rest someone asks, so that a page stays light. */
  sketch() {
    const figure = this.figure();
    this.ask.hidden = !figure || Boolean(figure.ticks) || Boolean(globalThis.Plotly);
    if (!figure?.ticks) return;
    this.plot.querySelector(".sketch, .nothing")?.remove();
    this.plot.append(sketch(figure, { width: this.plot.clientWidth, height: this.height }));
    this.element.dataset.sketched = "yes";
    painted().then(() => performance.mark(`sketched ${this.id}`));
  }

  /** The light drawing is of one width; the library follows by itself. */
  resized() {
    if (this.element.dataset.sketched && !this.element.dataset.drawn && this.plot.clientWidth > 0) this.sketch();
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
    const names = columns.map(({ name }) => name);
    const cells = rows.slice(0, MOST_ROWS).map((row) => row.map((value, index) => cellText(value, columns[index])));
    const cut = `The first ${cells.length} of ${rows.length} rows; the CSV holds all.`;
    this.table.replaceChildren(table(this.title, names, cells), rows.length > cells.length ? quiet(cut) : "");
  }

  /**
   * The light drawing as an image's address, in any size and scheme; null where there is none.
   * @param {Size & { scheme?: Scheme }} options
   */
  light({ width, height, scheme = null }) {
    const figure = this.figure(scheme, { width, height, compact: false });
    if (!figure?.ticks) return null;
    const text = new XMLSerializer().serializeToString(sketch(figure, { width, height }));
    return `data:image/svg+xml,${encodeURIComponent(text)}`;
  }

  async savePng() {
    const library = await plotly();
    const [width, height] = [1000, 600];
    if (this.spatial && !this.element.dataset.drawn) await this.draw();
    const figure = this.figure(null, { width, height, compact: false });
    if (figure === null) return;
    // a chart in 3D is saved as it has been turned
    const shown = this.spatial ? this.plot : { data: figure.data, layout: { ...figure.layout, width } };
    const image = await library.toImage(shown, { format: "png", width, height, scale: 2 });
    save(`${this.name()}-${this.id}.png`, image);
  }

  /** @param {"csv" | "xlsx"} format */
  saveTable(format) {
    if (!this.spec?.rows) return;
    const { columns, rows } = this.spec;
    saveTable(`${this.name()}-${this.id}.${format}`, [columns.map(({ name }) => name), ...rows]);
  }
}

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
