// Numbers as a person reads them: grouped, with their unit, and with no more digits than are known.

const MINUS = "−";

const UNITS = { c: "°C", bar: "bar", rpm: "rpm", nm: "Nm", s: "s", hz: "Hz" };

/** A name that ends in its unit, as `oil_temperature_c`: Oil temperature, °C. */
export function quantity(name) {
  const [, stem, unit] = /^(.*)_([a-z]+)$/.exec(name) ?? [null, name, ""];
  return UNITS[unit] ? `${words(stem)}, ${UNITS[unit]}` : words(name);
}

/** A number with that many decimals, thousands grouped. */
export function fixed(value, decimals = 0) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const text = Math.abs(value).toLocaleString("en-GB", { minimumFractionDigits: decimals, maximumFractionDigits: decimals });
  return (value < 0 && /[1-9]/.test(text) ? MINUS : "") + text;
}

/** A number with that many significant digits. */
export function significant(value, digits = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.floor(Math.log10(Math.abs(value)));
  if (size >= 6 || size < -4) return value.toExponential(digits - 1).replace("-", MINUS);
  const unit = 10 ** (size - digits + 1);
  return fixed(unit > 1 ? Math.round(value / unit) * unit : value, Math.max(0, digits - 1 - size));
}

/** A value and its deviation: the deviation to one digit (two where it starts with 1), the value to the same place. */
export function withSd(value, sd) {
  if (value === null || value === undefined) return "–";
  if (!sd || !Number.isFinite(sd)) return significant(value, 4);
  const size = Math.floor(Math.log10(sd));
  const decimals = Math.min(8, Math.max(0, -size + (sd / 10 ** size < 2 ? 1 : 0)));
  return `${fixed(value, decimals)} ± ${fixed(sd, decimals)}`;
}

/** Cycles, rounded to a twentieth of the interval that they lie in, but to no fewer than two digits. */
export function cycles(value, low = null, high = null) {
  if (value === null || value === undefined) return "–";
  const width = low !== null && high !== null ? high - low : Math.abs(value) / 50;
  const coarsest = 10 ** (Math.floor(Math.log10(Math.max(10, Math.abs(value)))) - 1);
  const unit = width > 20 ? Math.min(coarsest, 10 ** Math.floor(Math.log10(width / 10))) : 1;
  return fixed(Math.round(value / unit) * unit);
}

/** The 90 % interval of quantiles by name. */
export function interval(quantiles) {
  const [low, high] = [quantiles["0.05"], quantiles["0.95"]];
  if (low === null && high === null) return "–";
  if (high === null) return `over ${cycles(low)}`;
  return `${cycles(low, low, high)} to ${cycles(high, low, high)}`;
}

export const percent = (share, decimals = 0) => (share === null || share === undefined ? "–" : `${fixed(100 * share, decimals)} %`);

/** A probability: never rounded to certainty. */
export function probability(value) {
  if (value === null || value === undefined) return "–";
  if (value > 0 && value < 0.005) return "< 1 %";
  if (value < 1 && value > 0.995) return "> 99 %";
  return percent(value);
}

const STEPS = [[60, "s"], [60, "min"], [24, "h"], [365, "days"], [Infinity, "years"]];

/** How long ago a moment was, in one unit. */
export function age(moment, now = Date.now()) {
  let left = Math.max(0, (now - moment) / 1000);
  if (left < 5) return "just now";
  for (const [size, unit] of STEPS) {
    if (left < size) {
      const count = Math.floor(left);
      return `${count} ${count === 1 ? unit.replace(/s$/, "") || "s" : unit} ago`;
    }
    left /= size;
  }
  return "–";
}

/** A moment on the reader's clock. */
export function moment(text) {
  if (!text) return "–";
  return new Date(text).toLocaleString("en-GB", { day: "numeric", month: "short", year: "numeric", hour: "2-digit", minute: "2-digit" });
}

export const clock = (when) => when.toLocaleTimeString("en-GB");

const KINDS = {
  stationary_stribeck: "Stationary Stribeck test", dynamic_stribeck: "Dynamic Stribeck test", duty_cycles: "Duty cycles", run_in: "Run-in", maintenance: "Maintenance",
};

/** What kind of run it is, in words. */
export const kindName = (kind) => KINDS[kind] ?? words(kind);

/** snake_case as words. */
export function words(name) {
  const text = String(name).replaceAll("_", " ");
  return text.charAt(0).toUpperCase() + text.slice(1);
}

/** `60000 ms` as `1 min`. */
export const seconds = (milliseconds) => (milliseconds < 60_000 ? `${Math.max(1, Math.round(milliseconds / 1000))} s` : `${Math.round(milliseconds / 60_000)} min`);
