// The plotting library, loaded once and only where a chart is drawn.

let loading = null;

/** Plotly, when its script has run; it is a file of this service. */
export function plotly() {
  loading ??= new Promise((ready, fail) => {
    const script = document.createElement("script");
    script.src = new URL("./plotly.min.js", import.meta.url).href;
    script.onload = () => ready(globalThis.Plotly);
    script.onerror = () => { loading = null; script.remove(); fail(new Error("the plotting library did not load")); };
    document.head.append(script);
  });
  return loading;
}

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
