// The service's API: the reader's key, entity tags, and errors as values that can be shown.

const KEY = "clutchlife-key";

export const key = {
  get: () => { try { return sessionStorage.getItem(KEY); } catch { return null; } },
  set: (text) => { try { sessionStorage.setItem(KEY, text); } catch { /* it holds for this answer only */ } },
  forget: () => { try { sessionStorage.removeItem(KEY); } catch { /* nothing was kept */ } },
};

/** An answer that is no success; `status` 0 means that there was no answer at all. */
export class Problem extends Error {
  constructor(status, { title = "", detail = "", errors = [], total_errors: total = 0 } = {}, retryAfter = null) {
    super(detail || title || `status ${status}`);
    Object.assign(this, { status, title, detail, errors, total, retryAfter });
  }

  get needsKey() { return this.status === 401; }
}

async function ask(path, options = {}) {
  const headers = new Headers(options.headers);
  if (key.get()) headers.set("Authorization", `Bearer ${key.get()}`);
  let answer;
  try {
    answer = await fetch(path, { cache: "no-store", ...options, headers });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Problem(0, { title: "The service does not answer" });
  }
  if (answer.ok || answer.status === 304) return answer;
  const told = await answer.json().catch(() => ({ title: answer.statusText }));
  throw new Problem(answer.status, told, Number(answer.headers.get("Retry-After")) || null);
}

/** What was last read of an address, and its tag: asked again, an unchanged answer costs a few hundred bytes. */
const known = new Map();

/** The answer's body, and whether it is another than last time. */
export async function read(path) {
  const before = known.get(path);
  const answer = await ask(path, before ? { headers: { "If-None-Match": before.tag } } : {});
  if (answer.status === 304) {
    await answer.arrayBuffer(); // an answer that is not read to its end keeps its connection busy
    return { body: before.body, changed: false };
  }
  const body = await answer.json();
  known.set(path, { tag: answer.headers.get("ETag"), body });
  return { body, changed: true };
}

/** All items of a list, page by page. */
export async function readAll(path) {
  const items = [];
  let changed = false;
  let cursor = null;
  do {
    const page = await read(cursor === null ? path : `${path}${path.includes("?") ? "&" : "?"}cursor=${encodeURIComponent(cursor)}`);
    items.push(...page.body.items);
    changed ||= page.changed;
    cursor = page.body.next;
  } while (cursor !== null && cursor !== undefined);
  return { items, changed };
}

/** Send something; the answer's body and status. */
export async function send(method, path, body, headers = {}) {
  const answer = await ask(path, { method, body, headers });
  const text = await answer.text();
  return { status: answer.status, location: answer.headers.get("Location"), body: text ? JSON.parse(text) : null };
}

export const sendJson = (method, path, value, headers = {}) =>
  send(method, path, JSON.stringify(value), { "Content-Type": "application/json", ...headers });

/** An answer as text, for a file that the reader saves. */
export const readText = async (path) => (await ask(path)).text();

export const clutchPath = (id) => `/v1/clutches/${encodeURIComponent(id)}`;
