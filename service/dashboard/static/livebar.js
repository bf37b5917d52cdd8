// "As of": always in sight, with words for a screen reader only when something turns.

import { h } from "./dom.js";
import { clock, seconds } from "./format.js";

/** Draws how `Live` stands into the page's bar; returns what Live tells. */
export function liveBar(bar) {
  const dot = h("span", { class: "dot", "aria-hidden": "true" });
  const text = h("span", { class: "asof" });
  const turn = h("span", { class: "hidden", role: "status" });
  const retry = h("button", { type: "button", hidden: true }, "Try now");
  bar.append(dot, text, retry, turn);
  let was = null;
  let live = null;

  function say() {
    const [state, words] = standing(live);
    bar.dataset.state = state;
    text.textContent = words;
    retry.hidden = state !== "down";
    if (state !== was && was !== null) {
      turn.textContent = state === "down" ? "The service does not answer; what is shown may be out of date." : state === "live" ? "Live again." : "";
    }
    was = state;
  }

  retry.addEventListener("click", () => live.now());
  setInterval(() => { if (live?.problem) say(); }, 1000);
  return (told) => { live = told; say(); };
}

function standing(live) {
  const asOf = live.asOf ? `as of ${clock(live.asOf)}` : "nothing read yet";
  if (live.problem) return ["down", `${reason(live.problem)}; ${asOf}${live.nextAt ? `; next try in ${seconds(live.nextAt - Date.now())}` : ""}`];
  if (document.hidden) return ["paused", `Paused, ${asOf}`];
  return ["live", `Live, ${asOf}`];
}

function reason(problem) {
  if (problem.status === 0) return "No answer from the service";
  if (problem.needsKey) return "A key is needed";
  return problem.detail || problem.title || `Status ${problem.status}`;
}
