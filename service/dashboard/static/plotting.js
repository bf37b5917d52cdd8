// The plotting library, loaded once, where a chart is drawn and after what can be drawn without it: running its megabytes
// keeps the page busy for a second.

let loading = null;

/** Plotly, when its script has run; it is a file of this service. */
export function plotly() {
  loading ??= painted().then(script);
  return loading;
}

/** When the browser has shown what there is so far. */
export const painted = () => new Promise((done) => { requestAnimationFrame(() => setTimeout(done)); });

const script = () => new Promise((ready, fail) => {
  const element = document.createElement("script");
  element.src = new URL("./plotly.min.js", import.meta.url).href;
  element.onload = () => ready(globalThis.Plotly);
  element.onerror = () => { loading = null; element.remove(); fail(new Error("the plotting library did not load")); };
  document.head.append(element);
});

let webgl = null;

/** Whether this browser can draw in 3D. */
export function has3d() {
  if (webgl === null) {
    const context = document.createElement("canvas").getContext("webgl");
    webgl = context !== null;
    context?.getExtension("WEBGL_lose_context")?.loseContext();
  }
  return webgl;
}
