// How every chart looks: axes, margins, type, what the plotting library may do.

const FONT = 'system-ui, -apple-system, "Segoe UI", Roboto, "Noto Sans", sans-serif';
const COARSE = matchMedia("(pointer: coarse)");

/** As many decimals as the step between two ticks has, the same at every tick. */
const DIGITS = [
  [1, null, 0],
  [0.1, 0.99, 1],
  [0.01, 0.099, 2],
  [0.001, 0.0099, 3],
  [0.0001, 0.00099, 4],
  [null, 0.000099, 6],
].map(([from, to, decimals]) => ({ name: `${decimals}`, dtickrange: [from, to], value: `,.${decimals}f` }));

/**
 * A chart's own layout on top of what all charts share; what all axes share is the plotting library's template.
 * @type {(c: Colours, layout: Layout, options: { height: number, compact: boolean }) => WholeLayout}
 */
export function base(c, layout, { height, compact }) {
  const size = compact ? 11 : 12.5;
  const title = { standoff: 8, font: { size } };
  const axis = { gridcolor: c.line, zeroline: false, exponentformat: "none", tickformatstops: DIGITS, title };
  const flat = {
    ...axis,
    showline: true,
    linecolor: c.edge,
    ticks: "outside",
    tickcolor: c.edge,
    ticklen: 4,
    automargin: true,
  };
  const deep = { ...axis, color: c.ink, showbackground: false, tickfont: { size: compact ? 9 : 11 } };
  const view = {
    aspectmode: "manual",
    aspectratio: { x: 1.35, y: 1.1, z: 0.8 },
    camera: {
      eye: compact ? { x: 1.9, y: -2.1, z: 0.95 } : { x: 1.5, y: -1.6, z: 0.75 },
      center: { x: 0, y: 0, z: -0.12 },
    },
  };
  const flatMargin = { l: 56, r: 16, t: 12, b: 48, ...layout.margin };
  return {
    height,
    autosize: true,
    paper_bgcolor: c.panel,
    plot_bgcolor: c.panel,
    font: { family: FONT, size, color: c.ink },
    hoverlabel: { bgcolor: c.panel, bordercolor: c.edge, font: { color: c.ink, family: FONT, size: 12.5 } },
    hovermode: "closest",
    separators: ".,",
    dragmode: layout.scene ? "turntable" : COARSE.matches ? false : "zoom",
    legend: {
      orientation: "h",
      y: -62 / Math.max(80, height - 110),
      yanchor: "top",
      x: 0,
      traceorder: "normal",
      font: { size: compact ? 11 : 12 },
      bgcolor: "rgba(0,0,0,0)",
    },
    ...layout,
    ...(layout.scene && { scene: { ...view, ...layout.scene } }),
    margin: layout.scene ? { l: 0, r: 0, t: 0, b: 0 } : flatMargin,
    template: { layout: { xaxis: flat, yaxis: flat, scene: { xaxis: deep, yaxis: deep, zaxis: deep } } },
  };
}

/**
 * What the plotting library may do: no logo, no tool bar, and nothing that leaves this host.
 * @param {boolean} spatial
 */
export const config = (spatial) => ({
  responsive: true,
  displaylogo: false,
  displayModeBar: false,
  showTips: false,
  scrollZoom: false,
  staticPlot: spatial && COARSE.matches,
  doubleClick: "reset",
  plotlyServerURL: "",
  topojsonURL: "",
});

/**
 * What was done; the plotting library reads texts as markup, so nothing in a note may look like it.
 * @type {(event: string, note: string | null) => string}
 */
const nameOf = (event, note) =>
  event === "other" && note ? note.replaceAll("<", "‹").replaceAll(">", "›").slice(0, 40) : event.replaceAll("_", " ");

/** @type {(x: number, line: Required<Line>) => Shape} a line over the whole height */
export const vertical = (x, line) => ({ type: "line", x0: x, x1: x, y0: 0, y1: 1, yref: "paper", line });

/** @type {(events: Receipt[], c: Colours) => { shapes: Shape[], annotations: Annotation[] }} lines with names */
export function eventMarks(events, c) {
  return {
    shapes: events.map(({ cycles }) => vertical(cycles, { color: c.maintenance, width: 1.5, dash: "dot" })),
    annotations: events.map(({ cycles, event, note }) => ({
      x: cycles,
      y: 1,
      yref: "paper",
      yanchor: "top",
      xanchor: "left",
      text: nameOf(event ?? "", note),
      showarrow: false,
      font: { size: 11, color: c.maintenance },
      textangle: 90,
    })),
  };
}
