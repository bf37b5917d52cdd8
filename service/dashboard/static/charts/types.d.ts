// What charts are made of. For the checks alone, which know these types in every module; browsers never load this file.

type Cell = string | number | null | undefined;

/** A column of a chart's table; `text` writes a number for a reader, the CSV has it raw. */
type Column = { name: string; text?: (value: number) => string };

/** What a chart shows: a drawing with its table, or what is missing and how to get it; `cuts`: through a surface, and the one shown. */
type Spec =
  | { empty: string; note?: undefined; columns?: undefined; rows?: undefined; figure?: undefined; cuts?: undefined }
  | {
      empty?: undefined;
      note: string;
      columns: Column[];
      rows: Cell[][];
      figure: (colours: Colours) => Figure;
      cuts?: { options: [string, string][]; chosen: string };
    };

/** Colours as CSS. */
type Colours = Record<(typeof import("./palette.js").NAMES)[number], string>;
type Scheme = "light" | "dark" | null;
type Values = (number | null)[];
type Places = { x: Values; y: Values };
type Span = [number, number];

/** Panels beside each other, below each other where there is no room. */
type Figure = Panel[];
type Panel = { title?: string; x: Axis; y: Axis; curves: Curve[]; fields?: Field[]; marks?: Mark[] };

/** `zero`: from zero on; `names`: categories at 0, 1, 2, ... */
type Axis = { title: string; range?: Span; zero?: boolean; log?: boolean; names?: string[] };
type Line = { color: string; width?: number; dash?: "dash" | "dot" };
type Marker = { color: string; size?: number; edge?: { color: string; width: number } };

/** A line, points or both; `half`: of error bars; with `lower` a band between two edges; `silent`: not read out. */
type Curve = Places & Partial<{ name: string; line: Line; marker: Marker; half: number[]; silent: boolean } & Band>;
type Band = { lower: Places; fill: string };

/** Values over a grid: coloured cells, or isolines at `levels`, filled where `fill` is given; `z`: what the values are. */
type Grid = { x: number[]; y: number[]; values: Values[] };
type Field = Grid & { name?: string; z: string; levels?: number[]; fill?: (value: number) => string; line?: string };

/** A line over the whole panel at one x or y, with a text beside it; `turned`: along the line. */
type Mark = { x?: number; y?: number; line: Line; text: string; turned?: boolean };

/** A clutch, of which only the shape matters. */
type Shaped = Pick<ClutchOut, "geometry">;
type Size = { width: number; height: number };
type Tick = { at: number; text: string };

/** From data to px and back. */
type Scale = { axis: Axis; range: Span; to: (value: number) => number; from: (px: number) => number; ticks: Tick[] };

/** A panel with its place: the corner of its cell, of its axes, and their size. */
type Frame = { panel: Panel; left: number; l: number; t: number; bottom: number; inside: Size; x: Scale; y: Scale };

type LegendEntry = { curve: Curve; width: number; x: number; y: number };

/** A figure whose axes, ticks and legend have their places. */
type Framed = { frames: Frame[]; legend: LegendEntry[]; size: Size; font: { size: number; family: string } };

/** The part of its axes that a panel shows; none: all. */
type Zoom = { x: Span; y: Span } | undefined;
