// Numbers as a person reads them: grouped, with their unit, and with no more digits than their uncertainty allows.
// A dash stands wherever a value is null, undefined or not finite.

/** @typedef {number | null | undefined} Maybe a number, or none */

const MINUS = "−";
const NONE = "–";
const UNKNOWN = "unknown";

/** @type {Record<string, string>} */
const UNITS = { c: "°C", bar: "bar", rpm: "rpm", nm: "Nm", s: "s", hz: "Hz" };

/** @type {(name: string) => string} a name that ends in its unit, as `oil_temperature_c`: Oil temperature, °C */
export function quantity(name) {
  const [, stem, unit] = /^(.*)_([a-z]+)$/.exec(name) ?? ["", name, ""];
  return UNITS[unit] ? `${words(stem)}, ${UNITS[unit]}` : words(name);
}

/** @type {(value: Maybe) => value is number} */
const isNumber = (value) => value !== null && value !== undefined && Number.isFinite(value);

/** @type {(value: Maybe, decimals?: number) => string} a number with that many decimals, thousands grouped */
export function fixed(value, decimals = 0) {
  if (!isNumber(value)) return NONE;
  const digits = { minimumFractionDigits: decimals, maximumFractionDigits: decimals };
  const text = Math.abs(value).toLocaleString("en-GB", digits);
  return (value < 0 && /[1-9]/.test(text) ? MINUS : "") + text;
}

/** @type {(value: Maybe, digits?: number) => string} a number with that many significant digits */
export function significant(value, digits = 3) {
  if (!isNumber(value)) return NONE;
  if (value === 0) return "0";
  const size = Math.floor(Math.log10(Math.abs(value)));
  if (size >= 6 || size < -4) return value.toExponential(digits - 1).replaceAll("-", MINUS);
  const unit = 10 ** (size - digits + 1);
  return fixed(unit > 1 ? Math.round(value / unit) * unit : value, Math.max(0, digits - 1 - size));
}

/**
 * A value and its deviation: the deviation to one digit (two where it starts with 1), the value to the same place.
 * @type {(value: Maybe, sd: Maybe) => string}
 */
export function withSd(value, sd) {
  if (!isNumber(value)) return NONE;
  if (!sd || !Number.isFinite(sd)) return significant(value, 4);
  const size = Math.floor(Math.log10(sd));
  const decimals = Math.min(8, Math.max(0, -size + (sd / 10 ** size < 2 ? 1 : 0)));
  return `${fixed(value, decimals)} ± ${fixed(sd, decimals)}`;
}

/** @type {(value: Maybe, sd: Maybe) => string} one that is less than its deviation is not known */
export const estimate = (value, sd) =>
  isNumber(value) && isNumber(sd) && sd > Math.abs(value) ? UNKNOWN : withSd(value, sd);

/**
 * Cycles, rounded to a twentieth of the interval that they lie in, but to no fewer than two digits.
 * @type {(value: Maybe, low?: number | null, high?: number | null) => string}
 */
export function cycles(value, low = null, high = null) {
  if (!isNumber(value)) return NONE;
  const width = low !== null && high !== null ? high - low : Math.abs(value) / 50;
  const coarsest = 10 ** (Math.floor(Math.log10(Math.max(10, Math.abs(value)))) - 1);
  const unit = width > 20 ? Math.min(coarsest, 10 ** Math.floor(Math.log10(width / 10))) : 1;
  return fixed(Math.round(value / unit) * unit);
}

/** @type {(quantiles: Quantiles) => string} the 90 % interval of quantiles by name */
export function interval(quantiles) {
  const [low, high] = [quantiles["0.05"], quantiles["0.95"]];
  if (low === null && high === null) return NONE;
  if (high === null) return `${roundedDown(low ?? 0)} to over 1,000,000`;
  return `${cycles(low, low, high)} to ${cycles(high, low, high)}`;
}

/** @type {(quantiles: Quantiles) => string} what is likely of remaining cycles: the median and the 90 % interval */
export function likely(quantiles) {
  const about = quantiles["0.5"] === null ? "over 1,000,000" : `${median(quantiles)} or more`;
  return `50 % chance of ${about}; 90 % interval: ${interval(quantiles)}`;
}

/** Fewer cycles than this are not counted out. */
const FEW = 10;

/** @type {(bound: number | null) => string} the safe bound of remaining cycles, rounded down to two digits */
export function atLeast(bound) {
  if (bound === null || bound < 1) return "no further cycle is safe";
  return `safe for ${bound < FEW ? `fewer than ${FEW}` : roundedDown(bound)} (95\u00a0%)`;
}

/** @type {(value: number) => string} cycles, rounded down to two digits */
export function roundedDown(value) {
  const unit = 10 ** Math.max(0, Math.floor(Math.log10(Math.max(1, value))) - 1);
  return fixed(Math.floor(value / unit) * unit);
}

/** @type {(count: number, one: string, several?: string) => string} a number with what is counted: 1 run, 2 runs */
export const counted = (count, one, several = `${one}s`) => `${fixed(count)} ${count === 1 ? one : several}`;

/** @type {(quantiles: Quantiles) => string} the median, as far as the 90 % interval lets it be known */
export const median = (quantiles) => cycles(quantiles["0.5"], quantiles["0.05"], quantiles["0.95"]);

/** @type {(share: Maybe, decimals?: number) => string} a share of one as a percentage */
export const percent = (share, decimals = 0) => (isNumber(share) ? `${fixed(100 * share, decimals)} %` : NONE);

/** @type {(value: Maybe) => string} a probability: never rounded to certainty */
export function probability(value) {
  if (!isNumber(value)) return NONE;
  if (value < 0.005) return "< 1 %";
  if (value >= 0.995) return "> 99 %";
  return percent(value);
}

/** @type {[number, string, string][]} */
const STEPS = [
  [60, "s", "s"],
  [60, "min", "min"],
  [24, "h", "h"],
  [365, "day", "days"],
  [Infinity, "year", "years"],
];

/**
 * How long ago a moment was, in one unit.
 * @param {number} moment ms since 1970
 * @param {number} [now] the same
 */
export function age(moment, now = Date.now()) {
  let left = Math.max(0, (now - moment) / 1000);
  if (left < 5) return "just now";
  for (const [size, unit, units] of STEPS) {
    if (left < size) return `${counted(Math.floor(left), unit, units)} ago`;
    left /= size;
  }
  return NONE;
}

/** @type {(text: string | null | undefined) => string} a moment on the reader's clock; `text`: ISO 8601 */
export function moment(text) {
  if (!text) return NONE;
  return new Date(text).toLocaleString("en-GB", { dateStyle: "medium", timeStyle: "short" });
}

/** @param {Date} when */
export const clock = (when) => when.toLocaleTimeString("en-GB");

/** @type {Record<string, string>} */
const KINDS = {
  stationary_stribeck: "Stationary Stribeck test",
  dynamic_stribeck: "Dynamic Stribeck test",
  run_in: "Run-in",
};

/** @type {(kind: string) => string} what kind of run it is, in words */
export const kindName = (kind) => KINDS[kind] ?? words(kind);

/** @type {(run: { kind: string, cycles?: number }) => string} what a run is called in a sentence */
export const runName = ({ kind, cycles: at }) => `${kindName(kind)} at ${fixed(at)} cycles`;

/** @type {(name: unknown) => string} snake_case as words */
export function words(name) {
  const text = String(name).replaceAll("_", " ");
  return text.charAt(0).toUpperCase() + text.slice(1);
}

/** @type {(text: string, starts?: boolean) => string} `starts`: whether it starts with a capital letter */
export function sentence(text, starts = true) {
  const first = starts ? text.charAt(0).toUpperCase() : text.charAt(0);
  return `${first}${text.slice(1)}${/[.?!]$/.test(text) ? "" : "."}`;
}

/** @type {(milliseconds: number) => string} `60000 ms` as `1 min` */
export const seconds = (milliseconds) =>
  milliseconds < 60_000
    ? `${Math.max(1, Math.round(milliseconds / 1000))} s`
    : `${Math.round(milliseconds / 60_000)} min`;

export const NOT_A_NUMBER =
  "Write a number as 25.5 or 25,5. A comma before exactly three digits is not clear: 1,000 may mean 1000 or 1.0.";

/**
 * A number as it is typed: 25.5 and 25,5 are the same; null where nothing is, undefined where it cannot be read for certain.
 * @param {string} text
 */
export function numberOf(text) {
  const typed = text.replaceAll(/\s/g, "");
  if (typed === "") return null;
  if (/^\d{1,3}(,\d{3})+$/.test(typed) && !typed.startsWith("0,")) return undefined;
  const number = Number(typed.replace(/^([^.,]*),([^.,]*)$/, "$1.$2"));
  return Number.isFinite(number) ? number : undefined;
}
