// Names of registered clutches that are spelt almost as another: what a slip of typing makes of them.

import { read } from "../shared/api.js";

/** Names that are offered while one is typed, and looked through for what may have been meant. */
const OFFERED = 20;
const LOOKED_THROUGH = 100;

/** Letters that may differ between a slip of typing and the name that was meant. */
const MOST_DIFFERENT = 2;

/**
 * Registered names that contain this text, or whose material or fluid does.
 * @param {string} text
 */
export async function registeredLike(text, limit = OFFERED) {
  const { body } = await read(`/v1/clutches?sort=name&limit=${limit}&find=${encodeURIComponent(text)}`);
  return body.items.map((clutch) => clutch.clutch_id);
}

/**
 * Registered names that are spelt almost as this one. With one slip a half of the name is as it was meant, with two a third.
 * @param {string} id
 */
export async function similarRegistered(id) {
  const parts = [2, 3].flatMap((count) => split(id, count));
  const names = await Promise.all(parts.map((part) => registeredLike(part, LOOKED_THROUGH)));
  return similarTo(id, [...new Set(names.flat())]);
}

/** @type {(text: string, count: number) => string[]} */
function split(text, count) {
  const length = Math.ceil(text.length / count);
  return [...Array(count).keys()].map((part) => text.slice(part * length, (part + 1) * length)).filter(Boolean);
}

/** @type {(id: string, registered: string[]) => string[]} the names that are spelt almost as this one */
export function similarTo(id, registered) {
  const plain = bare(id);
  return registered
    .map((name) => ({ name, different: distance(plain, bare(name)) }))
    .filter(({ name, different }) => different <= Math.min(MOST_DIFFERENT, bare(name).length / 3))
    .sort((a, b) => a.different - b.different)
    .slice(0, 3)
    .map(({ name }) => name);
}

/** @param {string} id */
const bare = (id) => id.toLowerCase().replaceAll(/[^a-z0-9]/g, "");

/** @type {(a: string, b: string) => number} Levenshtein's distance */
function distance(a, b) {
  let row = [...Array(b.length + 1).keys()];
  for (let i = 1; i <= a.length; i += 1) {
    const next = [i];
    for (let j = 1; j <= b.length; j += 1) {
      next[j] = Math.min(row[j] + 1, next[j - 1] + 1, row[j - 1] + (a[i - 1] === b[j - 1] ? 0 : 1));
    }
    row = next;
  }
  return row[b.length];
}
