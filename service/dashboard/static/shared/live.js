// Polls the service: less often while errors last, not at all in a hidden tab, at once when someone looks again. How old the
// answers are is always in sight, with words for a screen reader only when the state changes.

import { key, Problem } from "./api.js";
import { asked } from "./dialog.js";
import { button, byId, field, h, quiet } from "./dom.js";
import { clock, seconds } from "./format.js";

const MAX_WAIT = 60_000; // ms

/** @type {Record<string, string>} */
const CHANGES = {
  down: "The service does not answer; the values shown may be out of date.",
  live: "Live again.",
  paused: "",
};

export class Live {
  failures = 0;
  running = false;
  again = false;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  timer;
  /** @type {Date | null} */
  asOf = null;
  /** @type {Problem | null} */
  problem = null;
  /** @type {number | null} when the next poll is due, ms since 1970 */
  nextAt = null;
  text = h("span.asof");
  change = h("span.hidden", { role: "status" });
  retry = button("Try now", () => this.now(), { hidden: true });

  /**
   * @param {() => Promise<void>} poll asks once and throws a Problem
   * @param {number} interval ms between two polls
   */
  constructor(poll, interval) {
    this.poll = poll;
    this.interval = interval;
    this.bar = byId("live");
    this.bar.append(h("span.dot", { "aria-hidden": "true" }), this.text, this.retry, this.change);
    document.addEventListener("visibilitychange", () => (document.hidden ? this.pause() : this.now()));
    addEventListener("online", () => this.now());
    setInterval(() => this.problem && this.draw(), 1000);
  }

  pause() {
    clearTimeout(this.timer);
    this.nextAt = null;
    this.draw();
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
      await this.polled();
      this.failures = 0;
      this.problem = null;
      this.asOf = new Date();
    } catch (error) {
      this.failures += 1;
      const own = !(error instanceof Problem); // the page's mistake, not the service's: tried again as after any error
      this.problem = own ? new Problem(-1, { title: `The page could not show the answer: ${error}` }) : error;
      if (own) reportError(error);
    }
    this.running = false;
    if (this.again) {
      this.again = false;
      return this.now();
    }
    this.plan();
  }

  /** Poll, asking for a key and polling again where one is needed. */
  async polled() {
    for (;;) {
      try {
        return await this.poll();
      } catch (error) {
        if (!(error instanceof Problem && error.status === 401)) throw error;
        await askForKey(error.detail);
      }
    }
  }

  plan() {
    if (document.hidden) return this.pause();
    const backedOff = this.failures ? Math.min(MAX_WAIT, this.interval * 2 ** (this.failures - 1)) : this.interval;
    const wait = Math.max(backedOff, (this.problem?.retryAfter ?? 0) * 1000);
    this.nextAt = Date.now() + wait;
    this.timer = setTimeout(() => this.now(), wait);
    this.draw();
  }

  draw() {
    const before = this.bar.dataset.state;
    const state = this.problem ? "down" : document.hidden ? "paused" : "live";
    const asOf = this.asOf ? `as of ${clock(this.asOf)}` : "nothing read yet";
    const next = this.nextAt ? `; next try in ${seconds(this.nextAt - Date.now())}` : "";
    this.bar.dataset.state = state;
    if (this.problem) this.text.textContent = `${reason(this.problem)}; ${asOf}${next}`;
    else this.text.textContent = `${document.hidden ? "Paused" : "Live"}, ${asOf}`;
    this.retry.hidden = state !== "down";
    if (before && state !== before) this.change.textContent = CHANGES[state];
  }
}

/** @param {Problem} problem */
function reason({ status, detail, title }) {
  return status === 0 ? "No answer from the service" : detail || title || `Status ${status}`;
}

const ABOUT =
  "Its operator creates a key. The scope read allows you to look; the scope ingest also allows you to send:";

/** @type {(detail: string) => Promise<unknown>} resolves when a key has been given; `detail`: why it is asked for */
function askForKey(detail) {
  const input = h("input", { id: "key", type: "password", required: true, spellcheck: "false" });
  const kept = quiet("It is kept in this tab until you close it, and sent to this service only.");
  return asked({
    title: "This service asks for a key",
    lines: [h("p", detail || ABOUT), h("pre", h("code", "clutchlife key create --scope read"))],
    fields: field(input, "Key", kept),
    action: "Use this key",
    leave: null,
    send: () => key.set(input.value.trim()),
  });
}
