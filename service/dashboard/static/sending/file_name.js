// What a file's name says of its run: the kind of test and its duty cycles, each null where the name leaves a doubt.

/** @typedef {{ kind: string | null, cycles: number | null }} Guess */
/** @typedef {{ text: string, start: number, end: number }} Token a word or a number of the name */

const DATE =
  /(?<!\d)(?:19|20)\d\d[-_.]?(?:0[1-9]|1[0-2])[-_.]?(?:0[1-9]|[12]\d|3[01])(?:[-_ T]*(?:[01]\d|2[0-3])[-_.:h]?[0-5]\d(?:[-_.:]?[0-5]\d)?(?!\d))?(?!\d)/g;
const KIND = /^(stat|dyn|strib|loop|sweep)/i;
const CYCLES = /^(cycles?|cyc|zyklen)$/i;
/** A number before one of these is a pressure, a speed, a time or the like. */
const UNIT = /^(bar|rpm|hz|c|degc|nm|kpa|mpa|s|min|h|mm|cst|kj)$/i;
/** A number of cycles that stands without the word: zero, or from here on; smaller ones count files. Chosen. */
const LEAST_UNNAMED = 100;

/** @type {(name: string) => Guess} */
export function guess(name) {
  const stem = name.replace(/(\.(csv|txt|tdms|mf4|mdf|parquet|json|gz))+$/i, "").replaceAll(DATE, " ");
  return { kind: kindIn(stem), cycles: cyclesIn(stem) };
}

/** @param {string} stem */
function kindIn(stem) {
  const dynamic = /dyn|loop/i.test(stem);
  const stationary = /stat|sweep/i.test(stem) || (!dynamic && /stribeck/i.test(stem));
  if (dynamic === stationary) return null;
  return dynamic ? "dynamic_stribeck" : "stationary_stribeck";
}

/** @param {string} stem */
function cyclesIn(stem) {
  const tokens = [...stem.matchAll(/[A-Za-z]+|\d+(?:\.\d+)?/g)].map((match) => {
    return { text: match[0], start: match.index, end: match.index + match[0].length };
  });
  const numbers = tokens.flatMap((token, index) => (/^\d/.test(token.text) ? numberAt(tokens, index) : []));
  for (const by of ["cycles", "kind before", "kind after"]) {
    const values = numbers.filter((number) => number.by === by && (by === "cycles" || isCount(number.value)));
    if (values.length > 0) return values.length === 1 ? values[0].value : null;
  }
  const [only] = numbers;
  return numbers.length === 1 && only.by === "nothing" && isCount(only.value) ? only.value : null;
}

/** @param {number} value */
const isCount = (value) => value === 0 || value >= LEAST_UNNAMED;

/** @type {(tokens: Token[], index: number) => { value: number, by: string }} `by`: the word that says what it counts */
function numberAt(tokens, index) {
  const token = tokens[index];
  const before = index > 0 ? tokens[index - 1] : undefined;
  const thousands = tokens[index + 1]?.start === token.end && /^k$/i.test(tokens[index + 1].text);
  const after = tokens[index + (thousands ? 2 : 1)];
  const value = Math.round(Number(token.text) * (thousands ? 1000 : 1) * 1e6) / 1e6;
  const touches = before?.end === token.start;
  if (CYCLES.test(after?.text ?? "") || CYCLES.test(before?.text ?? "")) return { value, by: "cycles" };
  if (UNIT.test(after?.text ?? "")) return { value, by: "unit" };
  if (KIND.test(before?.text ?? "")) return { value, by: "kind before" };
  if (touches || /^\D/.test(before?.text ?? "")) return { value, by: "word" };
  if (KIND.test(after?.text ?? "")) return { value, by: "kind after" };
  return { value, by: /^0\d/.test(token.text) ? "word" : "nothing" };
}
