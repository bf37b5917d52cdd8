// @ts-check
// Polls the service: less often while errors last, not at all in a hidden tab, at once when someone looks again.

import { Problem } from "./api.js";

const MOST_WAIT = 60_000; // ms

export class Live {
  /**
   * @param {() => Promise<void>} poll asks once and throws a Problem
   * @param {(live: Live) => void} changed hears after each step
   * @param {number} [interval] ms between two polls
   */
  constructor(poll, changed, interval = 2000) {
    this.poll = poll;
    this.changed = changed;
    this.interval = interval;
    this.failures = 0;
    /** @type {ReturnType<typeof setTimeout> | undefined} */
    this.timer = undefined;
    /** @type {Date | null} */
    this.asOf = null;
    /** @type {Problem | null} */
    this.problem = null;
    /** @type {number | null} */
    this.nextAt = null;
    this.running = false;
    this.again = false;
    document.addEventListener("visibilitychange", () => (document.hidden ? this.pause() : this.now()));
    addEventListener("online", () => this.now());
  }

  start() {
    return this.now();
  }

  pause() {
    clearTimeout(this.timer);
    this.nextAt = null;
    this.changed(this);
  }

  /** @type {() => Promise<void>} poll at once; a second call while one is under way polls once more after it */
  async now() {
    if (this.running) {
      this.again = true;
      return;
    }
    clearTimeout(this.timer);
    this.running = true;
    try {
      await this.poll();
      this.failures = 0;
      this.problem = null;
      this.asOf = new Date();
    } catch (error) {
      if (!(error instanceof Problem)) {
        this.running = false;
        this.fault(error);
        throw error;
      }
      this.failures += 1;
      this.problem = error;
    }
    this.running = false;
    if (this.again) {
      this.again = false;
      return this.now();
    }
    this.plan();
  }

  /**
   * The page's own mistake, not the service's: shown on the page, and tried again as after any error.
   * @param {unknown} error
   */
  fault(error) {
    const message = error instanceof Error ? error.message : String(error);
    this.failures += 1;
    this.problem = new Problem(-1, { title: `The page could not show the answer: ${message}` });
    this.plan();
  }

  plan() {
    if (document.hidden || this.problem?.needsKey) {
      this.pause();
      return;
    }
    const backedOff = this.failures ? Math.min(MOST_WAIT, this.interval * 2 ** (this.failures - 1)) : this.interval;
    const wait = Math.max(backedOff, (this.problem?.retryAfter ?? 0) * 1000);
    this.nextAt = Date.now() + wait;
    this.timer = setTimeout(() => this.now(), wait);
    this.changed(this);
  }
}
