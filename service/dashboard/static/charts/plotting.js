// The plotting library, loaded once, where a chart cannot be drawn without it or someone points at one that can: it is as
// large as all else that a page loads, ten times over, and running it keeps the page busy for a second.

/** @type {Promise<Plotting> | null} */
let loading = null;

/** @type {PromiseWithResolvers<void>} */
const need = Promise.withResolvers();
/** When something has needed the library. */
export const wanted = need.promise;

/** Draw by the library from now on what is drawn light: someone points at it, to zoom or to read values. */
export const want = () => need.resolve();

/** Plotly, when its script has run; it is a file of this service. */
export function plotly() {
  want();
  loading ??= painted().then(script);
  return loading;
}

/** @type {() => Promise<void>} when the browser has shown what there is so far */
export const painted = () =>
  new Promise((resolve) => {
    requestAnimationFrame(() => setTimeout(resolve));
  });

/** @returns {Promise<Plotting>} */
const script = () =>
  new Promise((resolve, reject) => {
    const element = document.createElement("script");
    const fail = () => {
      loading = null;
      element.remove();
      reject(new Error("the plotting library did not load"));
    };
    element.src = new URL("../plotly.min.js", import.meta.url).href;
    element.onload = () => (globalThis.Plotly ? resolve(globalThis.Plotly) : fail());
    element.onerror = fail;
    document.head.append(element);
  });

/** @type {boolean | null} */
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
