// The rows of the table: only those about the part of the list that is in sight are read and drawn, whatever its length.
// What lies above and below them is empty space of the height that they would take.

import { h } from "../shared/dom.js";
import { COLUMNS, kindOf, row } from "./row.js";

/**
 * @typedef {object} Entry a clutch that is drawn
 * @property {string} text all that its row shows; the same text keeps the row
 * @property {HTMLElement} element
 * @typedef {{ offset: number, limit: number }} Part of the list
 */

/** Rows of a block, at least a screen of them: drawn are the block in sight and one on either side. */
const BLOCK = 40;
/** The height of a row before one is measured, px. */
const USUAL_HEIGHT = 44;

export class Rows {
  /**
   * @param {() => void} moved hears that another part of the list is to be shown
   * @param {() => void} picked hears that other clutches are chosen
   */
  constructor(moved, picked) {
    this.moved = moved;
    this.picked = picked;
    /** @type {Set<string>} clutches that are chosen, to compare or to archive */
    this.chosen = new Set();
    /** Whether clutches of a kind stand together, each kind under its name. */
    this.grouped = false;
    this.above = space();
    this.body = h("tbody", { role: "rowgroup" });
    this.below = space();
    const heading = { role: "columnheader", scope: "col" };
    const columns = COLUMNS.map(([name, width]) => h("th", { ...heading, style: { width } }, name));
    this.element = h(
      "table.fleet",
      { role: "table" },
      h("caption.hidden", "Clutches, what needs somebody first"),
      h("thead", { role: "rowgroup" }, h("tr", { role: "row", "aria-rowindex": 1 }, columns)),
      this.above,
      this.body,
      this.below,
    );
    /** @type {Map<string, Entry>} */
    this.entries = new Map();
    this.offset = 0;
    this.limit = 0;
    this.total = 0;
    this.height = USUAL_HEIGHT;
    this.looking = false;
    addEventListener("scroll", () => this.look(), { passive: true });
    addEventListener("resize", () => {
      this.measure();
      this.look();
    });
  }

  /** The part of the list to read, by what is in sight; of a short list, and of one not known yet to show it soon, a screen. */
  wanted() {
    const screen = Math.ceil(innerHeight / USUAL_HEIGHT);
    if (this.total <= screen) return { offset: 0, limit: screen };
    const block = Math.max(BLOCK, Math.ceil(innerHeight / this.height));
    const within = Math.floor(Math.max(0, Math.min(this.first(), this.total - 1)) / block);
    const offset = Math.max(0, within - 1) * block;
    return { offset, limit: (within + 2) * block - offset };
  }

  /** Another list is to be shown, from its beginning. */
  restart() {
    this.offset = 0;
    this.total = 0;
    if (this.element.getBoundingClientRect().top < 0) this.element.scrollIntoView();
  }

  /**
   * Show a part of a list of so many clutches; `scale` is the cycles at the right end of every interval's bar.
   * @param {ClutchOut[]} items
   * @param {Part} part that was asked for
   * @param {number} total
   * @param {number} scale
   */
  show(items, { offset, limit }, total, scale) {
    const first = this.first();
    const before = this.topOf(first);
    const kinds = this.grouped ? items.map(kindOf) : [];
    const group = (/** @type {number} */ index) => (kinds[index] === kinds[index - 1] ? null : (kinds[index] ?? null));
    this.arrange(items.map((clutch, index) => this.drawn(clutch, scale, group(index))));
    const present = new Set(items.map((clutch) => clutch.clutch_id));
    for (const id of this.entries.keys()) if (!present.has(id)) this.entries.delete(id);
    [...this.body.children].forEach((element, index) =>
      element.setAttribute("aria-rowindex", String(offset + index + 2)),
    );
    this.element.setAttribute("aria-rowcount", String(total + 1));
    if (this.offset === 0 && this.total === 0) this.measure();
    this.offset = offset;
    this.limit = limit;
    this.total = total;
    const room = offset * this.height;
    this.above.style.height = `${room}px`;
    this.below.style.height = `${Math.max(0, total - offset - items.length) * this.height}px`;
    // what is in sight stays where it is, though rows above it were guessed higher or lower than they are: by the empty space,
    // for to scroll would end a scroll that is under way
    const moved = before === null ? 0 : (this.topOf(first) ?? before) - before;
    if (offset > 0) this.above.style.height = `${Math.max(0, room - moved)}px`;
    else if (Math.abs(moved) >= 1) scrollBy(0, moved);
    this.look();
  }

  /** The row's element: a clutch that did not change keeps its row, so nothing flickers. */
  drawn(/** @type {ClutchOut} */ clutch, /** @type {number} */ scale, /** @type {string | null} */ group) {
    const { clutch_id: id } = clutch;
    const text = `${scale} ${group} ${JSON.stringify(clutch)}`;
    const before = this.entries.get(id);
    if (before?.text === text) return before.element;
    const choose = (/** @type {boolean} */ chosen) => {
      if (chosen) this.chosen.add(id);
      else this.chosen.delete(id);
      this.picked();
    };
    const element = row(clutch, { scale, group, chosen: this.chosen.has(id), choose });
    if (before !== undefined) element.classList.add("fresh");
    this.entries.set(id, { text, element });
    return element;
  }

  /**
   * Put rows into the table in this order; those that are there already are not touched, and the focus stays.
   * @param {HTMLElement[]} order
   */
  arrange(order) {
    const focused = document.activeElement;
    const { children } = this.body;
    for (const [index, element] of order.entries()) {
      if (children[index] !== element) this.body.insertBefore(element, children[index] ?? null);
    }
    while (children.length > order.length) children[order.length].remove();
    if (focused instanceof HTMLElement && this.body.contains(focused)) focused.focus({ preventScroll: true });
  }

  /** Look where the page stands, once a frame, and say so where that is another part of the list. */
  look() {
    if (this.looking) return;
    this.looking = true;
    requestAnimationFrame(() => {
      this.looking = false;
      if (!this.element.isConnected || this.total === 0) return;
      const { offset, limit } = this.wanted();
      const more = Math.min(limit, this.total) !== Math.min(this.limit, this.total);
      if (offset !== this.offset || more) this.moved();
    });
  }

  /** The place in the list of the first row in sight, by its row where it is drawn, else by the empty space. */
  first() {
    const { top, bottom } = this.body.getBoundingClientRect();
    if (top > 0) return this.offset - Math.ceil(top / this.height);
    const rows = [...this.body.children];
    if (bottom <= 0) return this.offset + rows.length + Math.floor(-bottom / this.height);
    return this.offset + rows.findIndex((element) => element.getBoundingClientRect().bottom > 0);
  }

  /** @param {number} index in the list */
  topOf(index) {
    return this.body.children[index - this.offset]?.getBoundingClientRect().top ?? null;
  }

  measure() {
    const rows = this.body.children.length;
    if (rows > 0) this.height = Math.max(1, this.body.getBoundingClientRect().height / rows);
  }
}

/** Room for rows that are not drawn. */
const space = () => h("tbody.space", { "aria-hidden": "true" });
