// @ts-check
// What the charts of the inspections show: R_a or R_sk of the surface profile over cycles, a line a lining.

import { CYCLES, digitsColumn, distinct } from "../charts/columns.js";
import { eventMarks } from "../charts/layout.js";
import { rampOf } from "../charts/palette.js";
import { titled } from "../charts/traces.js";
import { fixed } from "../shared/format.js";

/** @import { InspectionOut, Receipt } from "../shared/types.js" */
/** @import { Spec } from "../charts/types.js" */

/** The quantities: the axis' title, and what their course says. */
const QUANTITIES = {
  roughness_um: {
    title: "R<sub>a</sub>, µm",
    name: "R_a, µm",
    meaning: "Arithmetic mean roughness: it falls as the lining is worn smooth.",
  },
  skewness: {
    title: "R<sub>sk</sub>",
    name: "R_sk",
    meaning: "Skewness of the heights: negative where peaks are flattened and valleys remain.",
  },
};

/** @typedef {keyof typeof QUANTITIES} SurfaceQuantity */

/** @type {(lining: string) => string} a lining's name as the charts write it; without one, what it is */
const nameOf = (lining) => lining.replaceAll("<", "‹") || "lining"; // no markup comes from outside

/**
 * A quantity of the surface over cycles.
 * @type {(answers: { inspections: InspectionOut[], events: Receipt[], quantity: SurfaceQuantity }) => Spec}
 */
export function surfaceOverLife({ inspections, events, quantity }) {
  const { title, name, meaning } = QUANTITIES[quantity];
  const measured = inspections.filter((item) => item[quantity] !== null);
  if (measured.length === 0) return { empty: `No inspection has measured ${name.split(",")[0]} yet.` };
  const linings = [...new Set(measured.map(({ lining }) => lining))].sort();
  const states = distinct(measured.map(({ cycles }) => cycles)).length;
  return {
    note: `${meaning} Inspected at ${states === 1 ? "one number" : `${fixed(states)} different numbers`} of cycles.`,
    columns: [{ name: "lining" }, CYCLES, digitsColumn(name, 3)],
    rows: measured.map((item) => [item.lining, item.cycles, item[quantity]]),
    figure: (c) => ({
      data: linings.map((lining, index) => {
        const values = measured.filter((item) => item.lining === lining);
        const color = rampOf(c, index, linings.length);
        return {
          name: nameOf(lining),
          showlegend: linings.length > 1,
          mode: "lines+markers",
          x: values.map(({ cycles }) => cycles),
          y: values.map((item) => item[quantity]),
          line: { color, width: 1.4 },
          marker: { color, size: 7 },
          hovertemplate: `%{x:,.0f} cycles<br>${name} %{y:.4g}<extra>%{fullData.name}</extra>`,
        };
      }),
      layout: { xaxis: titled("duty cycles"), yaxis: titled(title), ...eventMarks(events, c) },
    }),
  };
}
