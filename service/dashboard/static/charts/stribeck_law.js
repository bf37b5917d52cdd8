// Eq. 1 and 3 once more, for drawing: torque over speed from fitted parameters, and the measured points beside it.

import { meanRadius, units } from "../shared/units.js";

/** @typedef {{ speed: number, torque: number }} CurvePoint rpm, Nm */

const GAMMA = 0.3;

/**
 * Eq. 3: M_s (1 + (M̄_c − 1) exp(−V_S/v)) + C_v v^0.3, Nm at v ≥ 0 m/s; `speed` in rpm.
 * @type {(speed: number, fit: Fit, clutch: Shaped) => number}
 */
export function torqueAtSpeed(speed, { parameters }, clutch) {
  const { static_torque_nm: mS, coulomb_ratio: mC, stribeck_velocity_m_s: vS, viscous_coefficient: cV } = parameters;
  const v = speed * ((meanRadius(clutch) * 2 * Math.PI) / 60);
  const e = v > 0 ? Math.exp(-vS / v) : 0;
  return mS * (1 + (mC - 1) * e) + cV * v ** GAMMA;
}

/**
 * The fitted curve of one pressure between two speeds, rpm; closer points near rest, where it is curved most.
 * @type {(fit: Fit, clutch: Shaped, from: number, to: number, count?: number) => CurvePoint[]}
 */
export function curveOf(fit, clutch, from, to, count = 80) {
  return Array.from({ length: count }, (_, index) => {
    const speed = from + (to - from) * (index / (count - 1)) ** 2;
    return { speed, torque: torqueAtSpeed(speed, fit, clutch) };
  });
}

/**
 * The highest torque of a curve, Nm, of which others are shares: the static torque may be zero.
 * @param {CurvePoint[]} points
 */
export const highestOf = (points) => Math.max(...points.map(({ torque }) => torque));

/**
 * The measured points near a pressure; a long raw record is thinned evenly.
 * @param {Channels} channels
 * @param {number} pressure bar
 * @param {{ gap?: number, most?: number }} [options] how near, bar, and how many points
 * @returns {CurvePoint[]}
 */
export function measuredOf({ pressure_bar: p, speed_rpm: n, torque_nm: m }, pressure, { gap = 0.25, most = 400 } = {}) {
  const near = [];
  for (let index = 0; index < n.length; index += 1) {
    if (Math.abs(p[index] - pressure) <= gap) near.push({ speed: n[index], torque: m[index] });
  }
  const step = Math.ceil(near.length / most);
  return step > 1 ? near.filter((_, index) => index % step === 0) : near;
}

/** @type {(points: CurvePoint[], pressure: number, clutch: ClutchOut) => CurvePoint[]} points in the chosen unit of torque */
export function inUnit(points, pressure, clutch) {
  const { of } = units().torque;
  return points.map(({ speed, torque }) => ({ speed, torque: of(torque, pressure, clutch) }));
}

/** @type {(points: CurvePoint[]) => { x: number[], y: number[] }} speeds and torques */
export const xyOf = (points) => ({ x: points.map(({ speed }) => speed), y: points.map(({ torque }) => torque) });
