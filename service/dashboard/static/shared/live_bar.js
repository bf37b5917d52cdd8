// @ts-check
// "As of": always in sight, with words for a screen reader only when the state changes.

import { h } from "./dom.js";
import { clock, seconds } from "./format.js";

/** @import { Problem } from "./api.js" */
/** @import { Live } from "./live.js" */

/** @type {Record<string, string>} */
const CHANGES = {
  down: "The service does not answer; the values shown may be out of date.",
  live: "Live again.",
  paused: "",
};

/**
 * Draws the state of `Live` into the page's bar; returns what Live calls when it changes.
 * @param {HTMLElement} bar
 */
export function liveBar(bar) {
  const dot = h("span", { class: "dot", "aria-hidden": "true" });
  const text = h("span", { class: "asof" });
  const change = h("span", { class: "hidden", role: "status" });
  const retry = h("button", { type: "button", hidden: true }, "Try now");
  bar.append(dot, text, retry, change);
  /** @type {string | null} */
  let before = null;
  /** @type {Live | null} */
  let live = null;

  /** @param {Live} polling */
  function draw(polling) {
    const [state, words] = status(polling);
    bar.dataset.state = state;
    text.textContent = words;
    retry.hidden = state !== "down";
    if (state !== before && before !== null) change.textContent = CHANGES[state];
    before = state;
  }

  retry.addEventListener("click", () => live?.now());
  setInterval(() => {
    if (live?.problem) draw(live);
  }, 1000);
  return (/** @type {Live} */ polling) => {
    live = polling;
    draw(live);
  };
}

/** @param {Live} live */
function status(live) {
  const asOf = live.asOf ? `as of ${clock(live.asOf)}` : "nothing read yet";
  if (live.problem) {
    const next = live.nextAt ? `; next try in ${seconds(live.nextAt - Date.now())}` : "";
    return ["down", `${reason(live.problem)}; ${asOf}${next}`];
  }
  return document.hidden ? ["paused", `Paused, ${asOf}`] : ["live", `Live, ${asOf}`];
}

/** @param {Problem} problem */
function reason(problem) {
  if (problem.status === 0) return "No answer from the service";
  if (problem.needsKey) return "A key is needed";
  return problem.detail || problem.title || `Status ${problem.status}`;
}
