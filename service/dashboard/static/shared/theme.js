// Light, dark, or as the system says. A plain script in the head, so that the page never flashes in the wrong one.
"use strict";
(() => {
  /** @type {Record<string, string>} */
  const NAMES = { auto: "Theme: system", light: "Theme: light", dark: "Theme: dark" };
  let theme = "auto";
  try {
    theme = localStorage.getItem("theme") ?? theme;
  } catch {
    /* a browser that stores nothing: the choice holds for this page only */
  }
  if (!NAMES[theme]) theme = "auto";
  const apply = () => {
    document.documentElement.dataset.theme = theme;
    const button = document.getElementById("theme");
    if (button !== null) button.textContent = NAMES[theme];
  };
  apply();
  const changed = () => document.dispatchEvent(new Event("themechange"));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", changed);
  document.addEventListener("DOMContentLoaded", () => {
    apply();
    document.getElementById("theme")?.addEventListener("click", () => {
      const order = Object.keys(NAMES);
      theme = order[(order.indexOf(theme) + 1) % order.length];
      try {
        localStorage.setItem("theme", theme);
      } catch {
        /* as above */
      }
      apply();
      changed();
    });
  });
})();
