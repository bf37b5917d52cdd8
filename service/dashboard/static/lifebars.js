// Remaining life before and after, on one scale.

import { h } from "./dom.js";
import { cycles, interval } from "./format.js";
import { intervalBar } from "./sparkline.js";

/** `{before, after}`: quantiles by name, or whole answers that hold them; null where neither is told. */
export function lifeBars({ before, after }, names = ["Before", "After"]) {
  const both = [before, after].map(quantilesOf);
  if (both.some((q) => q === null)) return null;
  const scale = 1.05 * Math.max(1, ...both.map((q) => q["0.95"] ?? 1.6 * (q["0.5"] ?? q["0.05"] ?? 0)));
  return h("dl", { class: "lifebars" }, both.flatMap((q, index) => [
    h("dt", {}, names[index]),
    h("dd", {}, h("b", {}, cycles(q["0.5"], q["0.05"], q["0.95"])), h("span", { class: "quiet" }, ` (90 %: ${interval(q)})`), intervalBar(q, scale))]));
}

function quantilesOf(told) {
  const found = told?.remaining_cycles ?? told;
  if (!found || found["0.5"] === undefined) return null;
  return { "0.05": null, "0.25": found["0.05"] ?? null, "0.75": found["0.95"] ?? null, "0.95": null, ...found };
}
