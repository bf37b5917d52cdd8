// What the page has read of its clutch: each answer of the API once for a state of the clutch, when a tab first needs it.

import { byMeanCof } from "../quantities/criteria.js";
import { clutchPath, read, readAll, readDrawn } from "../shared/api.js";

/** @import { Prediction } from "../charts/fan.js" */

export class Reader {
  /** @param {string} id */
  constructor(id) {
    this.id = id;
    this.path = clutchPath(id);
    /** @type {ClutchOut | null} as it was read last */
    this.clutch = null;
    /** @type {Map<string, Promise<any>>} */
    this.answers = new Map();
    /** @type {Record<string, Channels>} by run: samples never change, so each record is read once */
    this.channels = {};
  }

  /** @type {(clutch: ClutchOut) => void} the clutch has changed: everything is read again when it is next needed */
  renew(clutch) {
    this.clutch = clutch;
    this.answers.clear();
  }

  /** The clutch; the tabs are shown after it has been read. */
  present() {
    if (this.clutch === null) throw new Error("the clutch has not been read");
    return this.clutch;
  }

  /**
   * @template Answer
   * @param {string} key
   * @param {() => Promise<Answer>} ask
   * @returns {Promise<Answer>}
   */
  once(key, ask) {
    const before = this.answers.get(key);
    if (before) return before;
    const answer = ask();
    this.answers.set(key, answer);
    answer.catch(() => this.answers.delete(key)); // asked for again at the next poll
    return answer;
  }

  /**
   * @template {string} Query
   * @param {Query} query below the clutch
   * @returns {Promise<Items<`${ClutchPath}${Query}`>>}
   */
  all(query) {
    return this.once(query, async () => (await readAll(`${this.path}${query}`)).items);
  }

  life = () => this.once("life", async () => (await read(`${this.path}/remaining-useful-life`)).body);

  degradation = () => this.once("degradation", async () => (await read(`${this.path}/degradation`)).body);

  tests = () => this.all("/stribeck?limit=1000");

  loops = () => this.all("/loops");

  runs = () => this.all("/runs?limit=1000");

  /** Maintenance that counts: marks in every chart over cycles. */
  async events() {
    const runs = await this.all("/runs?kind=maintenance&limit=1000");
    return runs.filter(({ state }) => state === "accepted");
  }

  held = () => this.all("/runs?state=held&limit=1000");

  /** @type {() => Promise<Prediction[]>} the earlier predictions of this life's end */
  async predictions() {
    const [remaining, cof] = await Promise.all([
      this.all("/series?quantity=remaining_cycles"),
      this.all("/series?quantity=mean_cof"),
    ]);
    const pooled = cof.filter((row) => row.pressure_bar === null && row.run_id === null);
    const cofAt = new Map(pooled.map((row) => [row.cycles, row.value]));
    return remaining.map((row) => ({ at: row.cycles, cof: cofAt.get(row.cycles) ?? null, remaining: row }));
  }

  /** What the fan and the chart of earlier predictions show. */
  async forecast() {
    const [life, degradation, predictions, events] = await Promise.all([
      this.life(),
      this.degradation(),
      this.predictions(),
      this.events(),
    ]);
    const pooled = degradation.items.find((item) => item.quantity === "mean_cof" && item.pressure_bar === null);
    return { life: byMeanCof(life), pooled, predictions, events };
  }

  /** @type {(ids: (string | undefined)[]) => Promise<void>} the records of runs, thinned to what is drawn */
  async records(ids) {
    const wanted = [...new Set(ids)].flatMap((id) => (id === undefined || this.channels[id] ? [] : [id]));
    await Promise.all(
      wanted.map(async (id) => {
        this.channels[id] = (await readDrawn(this.id, id)).body.channels;
      }),
    );
  }
}
