// @ts-check
// Remaining life before and after, on one scale.

import { h } from "../shared/dom.js";
import { cycles, interval } from "../shared/format.js";
import { intervalBar } from "../shared/sparkline.js";

/** @import { Quantiles } from "../shared/types.js" */

/** @typedef {Quantiles | { remaining_cycles?: Quantiles } | null | undefined} Answer quantiles by name, or what holds them */

/**
 * A bar for each; null where either answer holds no quantiles.
 * @type {(answers: { before: Answer, after: Answer }, names?: string[]) => HTMLElement | null}
 */
export function lifeBars({ before, after }, names = ["Before", "After"]) {
  const both = [before, after].map(quantilesOf).filter((quantiles) => quantiles !== null);
  if (both.length < 2) return null;
  const ends = both.map((q) => q["0.95"] ?? 1.6 * (q["0.5"] ?? q["0.05"] ?? 0));
  const scale = 1.05 * Math.max(1, ...ends);
  const rows = both.flatMap((q, index) => [
    h("dt", names[index]),
    h(
      "dd",
      h("b", cycles(q["0.5"], q["0.05"], q["0.95"])),
      h("span.quiet", ` (90 %: ${interval(q)})`),
      intervalBar(q, scale),
    ),
  ]);
  return h("dl.lifebars", rows);
}

/** @type {(answer: Answer) => Quantiles | null} missing quartiles are taken from the 90 % interval */
function quantilesOf(answer) {
  const quantiles = /** @type {Quantiles | null | undefined} */ (answer?.remaining_cycles ?? answer);
  if (!quantiles || quantiles["0.5"] === undefined) return null;
  const quartiles = { 0.25: quantiles["0.05"] ?? null, 0.75: quantiles["0.95"] ?? null };
  return { 0.05: null, 0.95: null, ...quartiles, ...quantiles };
}
