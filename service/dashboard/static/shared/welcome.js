// What a first visitor sees: what to do next, and the command for it.

import { here } from "./api.js";
import { copyable, h } from "./dom.js";

/** No clutch is registered yet. */
export function welcome() {
  return h(
    "section.welcome",
    { "aria-labelledby": "welcome-title" },
    h("h2", { id: "welcome-title" }, "No clutch is registered yet"),
    h("p", "The service runs and waits for a rig. This page fills by itself as soon as the first run arrives."),
    h("h3", "Try it with a simulated clutch"),
    copyable(`clutchlife simulate --seed 7 --out campaign\nclutchlife push campaign --clutch sim-7 --url ${here()}`),
    h("h3", "Connect a rig"),
    h("p", "Register the clutch; fields that you leave out take the values of the reference clutch:"),
    copyable(`clutchlife register bench3-017 --url ${here()}`),
    h(
      "p",
      "Then drop a recorder's file on this page (CSV, Excel, TDMS, MDF4, MATLAB, HDF5 or Parquet), or send it from a terminal:",
    ),
    copyable(`clutchlife import run-0001.csv --clutch bench3-017 --url ${here()}`),
    h("p", h("a", { href: "/docs" }, "The API"), " describes everything that can be sent, with examples."),
  );
}

/** @type {(id: string) => HTMLElement} a clutch without a run */
export function firstRun(id) {
  return h(
    "section.welcome",
    { "aria-labelledby": "first-title" },
    h("h2", { id: "first-title" }, "No run has arrived for this clutch yet"),
    h("p", "Drop a run's file on this page, or send it from where the rig writes it:"),
    copyable(`clutchlife push run-0001.json --clutch ${id} --url ${here()}`),
    h(
      "p",
      "The first stationary Stribeck test is the reference: ageing is the change since this test. ",
      "From the third test on, the service predicts the remaining cycles.",
    ),
  );
}
