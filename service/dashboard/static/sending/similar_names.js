// @ts-check
// Names that are spelt almost as another: what a slip of typing makes of them.

/** Letters that may differ between a slip of typing and the name that was meant. */
const MOST_DIFFERENT = 2;

/**
 * The names that are spelt almost as this one.
 * @param {string} id
 * @param {string[]} registered
 */
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

/**
 * Levenshtein's distance.
 * @param {string} a
 * @param {string} b
 */
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
