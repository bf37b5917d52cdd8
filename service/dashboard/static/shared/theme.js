// Light, dark, or as the system says. A plain script in the head, so that the page never flashes in the wrong one.
"use strict";
(() => {
  /** @type {Record<string, string>} */
  const NAMES = { auto: "Theme: system", light: "Theme: light", dark: "Theme: dark" };
  const stored = () => {
    try {
      return localStorage.getItem("theme") ?? "auto";
    } catch {
      return "auto";
    }
  };
  /** @param {string} theme */
  const apply = (theme) => {
    if (theme === "auto") document.documentElement.removeAttribute("data-theme");
    else document.documentElement.dataset.theme = theme;
  };
  apply(stored());
  const changed = () => document.dispatchEvent(new Event("themechange"));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", changed);
  document.addEventListener("DOMContentLoaded", () => {
    const button = document.getElementById("theme");
    if (button === null) return;
    let theme = NAMES[stored()] ? stored() : "auto";
    const label = () => {
      button.textContent = NAMES[theme];
    };
    label();
    button.addEventListener("click", () => {
      const order = Object.keys(NAMES);
      theme = order[(order.indexOf(theme) + 1) % order.length];
      try {
        localStorage.setItem("theme", theme);
      } catch {
        /* a browser that stores nothing: for this page only */
      }
      apply(theme);
      label();
      changed();
    });
  });
})();
