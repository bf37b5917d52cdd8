// Shared by both pages: answers of the API go in; values, elements, texts and states come out. Nothing here imports another
// chapter. Open this file first (the reader's key, entity tags, errors as values), then dom.js and format.js; the types of
// the API's answers are those of the OpenAPI document (tests/javascript/types.py).

/** The path of the service, with a slash at its end: modules lie in assets/DIGEST/FOLDER below it. */
const ROOT = new URL("../../../", import.meta.url).pathname;

/**
 * An address of the service, as `/docs`, where this page finds it; others as they are.
 * @param {string} address
 */
export const at = (address) => (address.startsWith("/") ? ROOT + address.slice(1) : address);

/** @type {(address: string) => string} the service's own address of one that an answer names */
export const own = (address) => (address.startsWith(ROOT) ? `/${address.slice(ROOT.length)}` : address);

/** The service's address for a command, without a slash at its end. */
export const here = () => (location.origin + ROOT).replace(/\/$/, "");

/**
 * What the browser keeps under a name; one that keeps nothing forgets it.
 * @type {(storage: () => Storage, name: string) => { get: () => string | null, set: (text: string) => void }}
 */
export const kept = (storage, name) => ({
  get: () => {
    try {
      return storage().getItem(name);
    } catch {
      return null;
    }
  },
  set: (text) => {
    try {
      storage().setItem(name, text);
    } catch {
      /* it holds for this page only */
    }
  },
});

export const key = kept(() => sessionStorage, "clutchlife-key");

/** An answer that is no success; `status` 0 means that there was no answer at all. */
export class Problem extends Error {
  /**
   * @param {number} status
   * @param {{ title?: string, detail?: string, errors?: ProblemError[], total_errors?: number }} [body] of RFC 9457
   * @param {number | null} [retryAfter] seconds
   */
  constructor(status, { title = "", detail = "", errors = [], total_errors: total = 0 } = {}, retryAfter = null) {
    super(detail || title || `status ${status}`);
    this.status = status;
    this.title = title;
    this.detail = detail;
    this.errors = errors;
    this.total = total;
    this.retryAfter = retryAfter;
  }
}

/** @type {(path: string, options?: RequestInit) => Promise<Response>} */
async function request(path, options = {}) {
  const headers = new Headers(options.headers);
  const secret = key.get();
  if (secret) headers.set("Authorization", `Bearer ${secret}`);
  let answer;
  try {
    answer = await fetch(at(path), { cache: "no-store", ...options, headers });
  } catch {
    throw new Problem(0, { title: "The service does not answer" });
  }
  if (answer.ok || answer.status === 304) return answer;
  const body = await answer.json().catch(() => ({ title: answer.statusText }));
  throw new Problem(answer.status, body, Number(answer.headers.get("Retry-After")) || null);
}

/** Addresses whose answers are kept: more than a page polls, fewer than a reader scrolls past in a long list. */
const MOST_KEPT = 64;

/**
 * What was last read of an address, and its tag: an unchanged answer costs a few hundred bytes. Those lately read come last.
 * @type {Map<string, { tag: string | null, body: any }>}
 */
const answers = new Map();

/**
 * The answer's body, of the type that the OpenAPI document gives it, and whether it is another than last time.
 * @template {string} Path
 * @param {Path} path
 * @returns {Promise<{ body: AnswerTo<"GET", Path>, changed: boolean }>}
 */
export async function read(path) {
  const before = answers.get(path);
  /** @type {Record<string, string>} */
  const headers = { Prefer: "wait=60" }; // a page that shows the clutch as it is waits for the newest answer
  if (before?.tag) headers["If-None-Match"] = before.tag;
  const answer = await request(path, { headers });
  const text = await answer.text(); // to its end, though it be empty: otherwise it keeps its connection busy
  const changed = answer.status !== 304 || before === undefined;
  const now = changed ? { tag: answer.headers.get("ETag"), body: JSON.parse(text) } : before;
  answers.delete(path);
  answers.set(path, now);
  if (answers.size > MOST_KEPT) answers.delete([...answers.keys()][0]);
  return { body: now.body, changed };
}

/**
 * What `read` gives; null where there is nothing at that address.
 * @template {string} Path
 * @param {Path} path
 */
export async function readIfThere(path) {
  try {
    return await read(path);
  } catch (problem) {
    if (problem instanceof Problem && problem.status === 404) return null;
    throw problem;
  }
}

/**
 * All items of a list, page by page, or those of its first `pages`; `more`: whether there are others.
 * @template {string} Path
 * @param {Path} path
 * @returns {Promise<{ items: Items<Path>, changed: boolean, more: boolean }>}
 */
export async function readAll(path, pages = Infinity) {
  const items = /** @type {Items<Path>} */ ([]);
  let changed = false;
  /** @type {string | null} */
  let cursor = null;
  do {
    pages -= 1;
    /** @type {string} */
    const address =
      cursor === null ? path : `${path}${path.includes("?") ? "&" : "?"}cursor=${encodeURIComponent(cursor)}`;
    const page = await read(address);
    items.push(...page.body.items);
    changed ||= page.changed;
    cursor = page.body.next ?? null;
  } while (cursor !== null && pages > 0);
  return { items, changed, more: cursor !== null };
}

/**
 * Send something, a plain object as JSON; the answer's body and status.
 * @template {string} Method
 * @template {string} Path
 * @param {Method} method
 * @param {Path} path
 * @param {BodyInit | object} body
 * @param {Record<string, string>} [headers]
 * @returns {Promise<{ status: number, location: string | null, body: AnswerTo<Method, Path> }>}
 */
export async function send(method, path, body, headers = {}) {
  const sent =
    body.constructor === Object
      ? { body: JSON.stringify(body), headers: { "Content-Type": "application/json", ...headers } }
      : { body: /** @type {BodyInit} */ (body), headers };
  const answer = await request(path, { method, ...sent });
  const text = await answer.text();
  const location = answer.headers.get("Location");
  return { status: answer.status, location: location && own(location), body: text ? JSON.parse(text) : null };
}

/** @type {(path: string) => Promise<string>} an answer as text, for a file that the reader saves */
export const readText = async (path) => (await request(path)).text();

/** @type {(path: string) => Promise<Blob>} a file that never changes under its address: the browser keeps it */
export const readFile = async (path) => (await request(path, { cache: "default" })).blob();

/** @param {string} id a clutch's page */
export const pageOf = (id) => `/clutches/${encodeURIComponent(id)}`;

/** @type {(id: string) => ClutchPath} */
export const clutchPath = (id) => `/v1/clutches/${encodeURIComponent(id)}`;

/** Samples of a run that a drawing asks for: as many as it shows, whatever the length of the record. */
const POINTS = 2000;

/** @type {(clutchId: string, runId: string) => Promise<{ body: RunOut }>} a run with its channels, thinned to what is drawn */
export const readDrawn = (clutchId, runId) =>
  read(`${clutchPath(clutchId)}/runs/${encodeURIComponent(runId)}?points=${POINTS}`);
