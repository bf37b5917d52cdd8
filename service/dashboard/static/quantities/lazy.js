// An answer that takes the service seconds: read when its section is looked at, and again only when another one is wanted.

import { Problem } from "../shared/api.js";
import { computing, watch } from "../shared/dom.js";

/** @import { Chart } from "../charts/chart.js" */

/** Before an answer that failed is asked for again, s. */
const AGAIN = 10;

/**
 * What is called with the name of the answer that is wanted: another name, another answer.
 * @param {Element} place what is looked at
 * @param {Chart[]} charts what the answer is shown in
 * @param {() => Promise<void>} read reads the answer that is wanted now, and shows it; throws a Problem
 */
export function lazy(place, charts, read) {
  let [near, running] = [false, false];
  let [wanted, done] = ["", ""];
  async function check() {
    if (!near || running || wanted === done) return;
    const now = wanted;
    running = true;
    for (const { note, title } of charts) computing(note, title.toLowerCase());
    try {
      await read();
      done = now;
    } catch (problem) {
      if (!(problem instanceof Problem)) throw problem;
      for (const { note } of charts) note.replaceChildren(`Not known: ${problem.message}. The page asks again.`);
      setTimeout(check, (problem.retryAfter ?? AGAIN) * 1000);
      return;
    } finally {
      running = false;
    }
    check(); // another answer may be wanted by now
  }
  watch(place, 200, (now) => {
    near = now;
    check();
  });
  return (/** @type {string} */ key) => {
    wanted = key;
    check();
  };
}
