// @ts-check
// An answer that takes the service seconds: read when its section is looked at, and again only when another one is wanted.

import { Problem } from "../shared/api.js";

/** @import { Chart } from "../charts/chart.js" */

/** Before an answer that failed is asked for again, s. */
const AGAIN = 10;

export class Lazy {
  /**
   * @param {Element} place what is looked at
   * @param {Chart[]} charts what the answer is shown in
   * @param {() => Promise<void>} read reads the answer that is wanted now, and shows it; throws a Problem
   */
  constructor(place, charts, read) {
    this.charts = charts;
    this.read = read;
    this.near = false;
    this.running = false;
    /** @type {string | null} */
    this.wanted = null;
    /** @type {string | null} */
    this.done = null;
    new IntersectionObserver(
      (entries) => {
        this.near = entries.some(({ isIntersecting }) => isIntersecting);
        this.check();
      },
      { rootMargin: "200px" },
    ).observe(place);
  }

  /** @param {string} key names the answer: another key, another answer */
  want(key) {
    this.wanted = key;
    this.check();
  }

  async check() {
    if (!this.near || this.running || this.wanted === null || this.wanted === this.done) return;
    const { wanted } = this;
    this.running = true;
    this.say("Being computed …");
    try {
      await this.read();
      this.done = wanted;
    } catch (problem) {
      if (!(problem instanceof Problem)) throw problem;
      this.say(`Not known: ${problem.message}. The page asks again.`);
      setTimeout(() => this.check(), (problem.retryAfter ?? AGAIN) * 1000);
      return;
    } finally {
      this.running = false;
    }
    this.check(); // another answer may be wanted by now
  }

  /** @param {string} text in place of the charts' notes */
  say(text) {
    for (const chart of this.charts) chart.note.textContent = text;
  }
}
