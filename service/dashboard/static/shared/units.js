// Units that the reader chooses, kept by the browser: friction as torque or as coefficient, SI or US. Files name the unit that they hold.

import { kept } from "./api.js";
import { menu } from "./dom.js";
import { fixed } from "./format.js";

/** @typedef {{ name: string, unit: string, decimals: number, of: (value: number, bar?: number, clutch?: Shaped) => number }} Unit */

const CHOICE = kept(() => localStorage, "clutchlife-units");
const PSI_PER_BAR = 14.5038;
const LBF_FT_PER_NM = 0.737562;

/** @type {{ system: "si" | "us", friction: "torque" | "cof" }} */
const USUAL = { system: "si", friction: "torque" };

function chosen() {
  try {
    return { ...USUAL, ...JSON.parse(CHOICE.get() ?? "{}") };
  } catch {
    return USUAL; // not as this page wrote it
  }
}

/**
 * Torque over the torque at a coefficient of friction of 1: faces x pressure x lining area x mean radius.
 * @type {(nm: number, bar?: number, clutch?: Shaped) => number}
 */
function cofOf(nm, bar, clutch) {
  if (bar === undefined || clutch === undefined) return NaN;
  const {
    inner_diameter_mm: inner,
    outer_diameter_mm: outer,
    friction_faces: faces,
    pressure_factor: factor,
  } = clutch.geometry;
  const area = (Math.PI / 4) * (outer ** 2 - inner ** 2) * 1e-6; // m²
  return nm / (faces * 1e5 * bar * factor * area * meanRadius(clutch));
}

/** @type {(clutch: Shaped) => number} (d_i + d_o)/4, or the one in the clutch's record, m */
export function meanRadius({ geometry }) {
  const mm = geometry.mean_radius_mm ?? (geometry.inner_diameter_mm + geometry.outer_diameter_mm) / 4;
  return mm / 1000;
}

/** @returns {{ torque: Unit, pressure: Unit }} how values are shown now */
export function units() {
  const { system, friction } = chosen();
  const us = system === "us";
  return {
    torque:
      friction === "cof"
        ? { name: "coefficient of friction µ", unit: "", decimals: 4, of: cofOf }
        : {
            name: "friction torque",
            decimals: 2,
            ...(us ? { unit: "lbf·ft", of: (nm) => LBF_FT_PER_NM * nm } : { unit: "Nm", of: (nm) => nm }),
          },
    pressure: us
      ? { name: "pressure", unit: "psi", decimals: 0, of: (bar) => PSI_PER_BAR * bar }
      : { name: "pressure", unit: "bar", decimals: 1, of: (bar) => bar },
  };
}

/** @type {(unit: Unit) => string} the name of an axis or a column with its unit */
export const named = ({ name, unit }) => (unit ? `${name}, ${unit}` : name);

/** @type {(bar: number | null | undefined) => string} a pressure as it is shown */
export function pressureText(bar) {
  const { unit, decimals, of } = units().pressure;
  return `${fixed(bar === null || bar === undefined ? bar : of(bar), decimals)} ${unit}`;
}

/** @type {(place: HTMLElement, changed: () => unknown) => void} a choice in the bar at the top; `changed`: hears of another one */
export function placeUnits(place, changed) {
  function draw() {
    const now = chosen();
    /** @type {(label: string, part: Partial<typeof now>) => { label: string, checked: boolean, onclick: () => void }} */
    const entry = (label, part) => ({
      label,
      checked: Object.entries(part).every(([name, value]) => now[/** @type {keyof typeof now} */ (name)] === value),
      onclick: () => {
        CHOICE.set(JSON.stringify({ ...now, ...part }));
        draw();
        changed();
      },
    });
    const entries = [
      entry("Friction as torque", { friction: "torque" }),
      entry("Friction as µ", { friction: "cof" }),
      entry("SI: Nm, bar, m/s", { system: "si" }),
      entry("US: lbf·ft, psi, ft/s", { system: "us" }),
    ];
    place.replaceChildren(menu("Units", entries));
  }
  draw();
}
