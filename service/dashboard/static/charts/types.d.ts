// What charts are made of, as far as these pages use it: what a chart shows, the plotting library's data and layout, and the
// little of the library itself that is called. For the checks alone, which know these types in
// every module; browsers never load this file.

type Cell = string | number | null | undefined;

/** A column of a chart's table; `text` writes a number for a reader, the CSV has it raw. */
interface Column {
  name: string;
  text?: (value: number) => string;
}

/** What a chart shows: a drawing with its table, or what is missing and how to get it. */
type Spec =
  | { empty: string; note?: undefined; columns?: undefined; rows?: undefined; figure?: undefined }
  | { empty?: undefined; note: string; columns: Column[]; rows: Cell[][]; figure: (colours: Colours) => Figure };

/** Colours as CSS. */
type Colours = Record<(typeof import("./palette.js").NAMES)[number], string>;
type Scheme = "light" | "dark" | null;

interface Figure {
  data: Trace[];
  layout: Layout;
}

interface Line {
  color?: string;
  width?: number;
  dash?: string;
}

interface Marker {
  color?: string;
  size: number;
  line?: { color: string; width: number };
}

interface ErrorBars {
  type: "data";
  array: number[];
  color: string;
  thickness: number;
  width: number;
}

/** Lines, points or a band over one pair of axes: what can be drawn without the library. */
interface PlainTrace {
  type?: "scatter";
  mode: string;
  x: (number | null)[];
  y: (number | null)[];
  name?: string;
  line?: Line;
  marker?: Marker;
  error_y?: ErrorBars;
  fill?: "tonexty";
  fillcolor?: string;
  showlegend?: boolean;
  legendgroup?: string;
  hoverinfo?: "skip";
  hovertemplate?: string;
  xaxis?: string;
  yaxis?: string;
}

interface OtherTrace {
  type: "surface" | "scatter3d" | "heatmap";
  [name: string]: unknown;
}

type Trace = PlainTrace | OtherTrace;
type Span = [number, number];

interface Axis {
  title?: { text?: string; standoff?: number; font?: { size: number } };
  range?: Span;
  rangemode?: "tozero";
  [name: string]: unknown;
}

/** A line; `paper` counts from 0 to 1 over the whole chart. */
interface Shape {
  type: "line";
  x0: number;
  x1: number;
  y0: number;
  y1: number;
  xref?: "paper";
  yref?: "paper";
  line: Required<Line>;
}

interface Annotation {
  x: number;
  y: number;
  xref?: "paper";
  yref?: "paper";
  xanchor?: string;
  yanchor?: string;
  text: string;
  textangle?: number;
  showarrow: false;
  font?: { size: number; color: string };
}

/** A chart's own layout. */
interface Layout {
  xaxis?: Axis;
  yaxis?: Axis;
  scene?: Record<"xaxis" | "yaxis" | "zaxis", Axis>;
  shapes?: Shape[];
  annotations?: Annotation[];
  margin?: Partial<WholeLayout["margin"]>;
  [name: string]: unknown;
}

/** A layout with all that the house adds. */
interface WholeLayout extends Layout {
  font: { family: string; size: number; color: string };
  margin: Record<"l" | "r" | "t" | "b", number>;
  legend: { font: { size: number }; [name: string]: unknown };
  paper_bgcolor: string;
  template: { layout: Record<"xaxis" | "yaxis", { gridcolor: string; linecolor: string }> & { scene: object } };
}

interface WholeFigure {
  data: Trace[];
  layout: WholeLayout;
}

interface Tick {
  at: number;
  text: string;
}

interface LegendEntry {
  trace: PlainTrace;
  width: number;
  x: number;
  y: number;
}

/** A figure whose axes, ticks and legend have their places before anything is drawn. */
interface SettledFigure {
  data: PlainTrace[];
  layout: WholeLayout & Record<"xaxis" | "yaxis", Axis & { range: Span }>;
  ticks: Record<"x" | "y", Tick[]>;
  legend: { entries: LegendEntry[]; top: number };
}

interface Size {
  width: number;
  height: number;
}

/** What is called of the plotting library. */
interface Plotting {
  react(place: HTMLElement, data: Trace[], layout: Layout, config: object): Promise<unknown>;
  purge(place: HTMLElement): void;
  toImage(figure: HTMLElement | Figure, options: Size & { format: "png"; scale: number }): Promise<string>;
}

/** Set by plotly.min.js. */
declare var Plotly: Plotting | undefined;
