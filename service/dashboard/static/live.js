// Asks again and again: less often while errors last, not at all in a hidden tab, at once when someone looks again.

import { Problem } from "./api.js";

const MOST_WAIT = 60_000;

export class Live {
  /** `look` asks once and throws a Problem; `tell` hears how it stands after each step. */
  constructor(look, tell, every = 2000) {
    Object.assign(this, { look, tell, every, failures: 0, timer: null, asOf: null, problem: null, nextAt: null, running: false });
    document.addEventListener("visibilitychange", () => (document.hidden ? this.pause() : this.now()));
    addEventListener("online", () => this.now());
  }

  start() { return this.now(); }

  pause() {
    clearTimeout(this.timer);
    this.timer = null;
    this.nextAt = null;
    this.tell(this);
  }

  /** Ask at once; a second call while one is under way asks once more after it. */
  async now() {
    if (this.running) { this.again = true; return; }
    clearTimeout(this.timer);
    this.running = true;
    try {
      await this.look();
      Object.assign(this, { failures: 0, problem: null, asOf: new Date() });
    } catch (error) {
      if (!(error instanceof Problem)) { this.running = false; this.fault(error); throw error; }
      this.failures += 1;
      this.problem = error;
    }
    this.running = false;
    if (this.again) { this.again = false; return this.now(); }
    this.plan();
  }

  /** Our own mistake, not the service's: said on the page, and asked again as after any error. */
  fault(error) {
    this.failures += 1;
    this.problem = new Problem(-1, { title: `The page could not show what it got: ${error.message}` });
    this.plan();
  }

  plan() {
    if (document.hidden || this.problem?.needsKey) { this.pause(); return; }
    const backedOff = this.failures ? Math.min(MOST_WAIT, this.every * 2 ** (this.failures - 1)) : this.every;
    const wait = Math.max(backedOff, (this.problem?.retryAfter ?? 0) * 1000);
    this.nextAt = Date.now() + wait;
    this.timer = setTimeout(() => this.now(), wait);
    this.tell(this);
  }
}
