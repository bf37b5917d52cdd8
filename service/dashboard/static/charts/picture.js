// A drawing as a picture: its elements painted on a canvas, so that no image has to be loaded from an address of its own.

/** @type {(drawing: SVGSVGElement, scale: number) => Promise<Blob>} PNG */
export function pngOf(drawing, scale) {
  const canvas = document.createElement("canvas");
  canvas.width = scale * Number(drawing.getAttribute("width"));
  canvas.height = scale * Number(drawing.getAttribute("height"));
  const pen = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  pen.scale(scale, scale);
  for (const child of drawing.children) paint(pen, child);
  return new Promise((resolve, reject) => {
    canvas.toBlob((blob) => (blob ? resolve(blob) : reject(new Error("no picture"))), "image/png");
  });
}

/** @type {(drawing: SVGSVGElement) => Blob} */
export const svgOf = (drawing) => new Blob([new XMLSerializer().serializeToString(drawing)], { type: "image/svg+xml" });

/** @type {(node: Element, name: string) => number} */
const number = (node, name) => Number(node.getAttribute(name) ?? 0);

/** @type {(node: Element, name: string) => string | null | undefined} an element's own attribute, or that of what it is in */
const inherited = (node, name) => node.closest(`[${name}]`)?.getAttribute(name);

/** @type {(node: Element) => Path2D} */
function shapeOf(node) {
  const path = new Path2D(node.getAttribute("d") ?? "");
  if (node.tagName === "rect")
    path.rect(number(node, "x"), number(node, "y"), number(node, "width"), number(node, "height"));
  if (node.tagName === "circle") path.arc(number(node, "cx"), number(node, "cy"), number(node, "r"), 0, 2 * Math.PI);
  if (node.tagName === "line") {
    path.moveTo(number(node, "x1"), number(node, "y1"));
    path.lineTo(number(node, "x2"), number(node, "y2"));
  }
  return path;
}

/** @type {(pen: CanvasRenderingContext2D, node: Element) => void} */
function paint(pen, node) {
  pen.save();
  const stroke = node.getAttribute("stroke") ?? "none";
  pen.fillStyle = inherited(node, "fill") ?? "none";
  pen.strokeStyle = stroke;
  pen.lineWidth = Number(node.getAttribute("stroke-width") ?? 1);
  pen.setLineDash((node.getAttribute("stroke-dasharray") ?? "").split(" ").filter(Boolean).map(Number));
  if (node.tagName === "text") write(pen, node, stroke !== "none");
  else if (node.tagName === "svg" || node.tagName === "g") {
    if (node.tagName === "svg") {
      pen.translate(number(node, "x"), number(node, "y"));
      pen.beginPath();
      pen.rect(0, 0, number(node, "width"), number(node, "height"));
      pen.clip();
    }
    for (const child of node.children) paint(pen, child);
  } else {
    const shape = shapeOf(node);
    if (inherited(node, "fill") !== "none" && node.tagName !== "line") pen.fill(shape);
    if (stroke !== "none") pen.stroke(shape);
  }
  pen.restore();
}

/** @type {(pen: CanvasRenderingContext2D, text: Element, halo: boolean) => void} its spans one after the other */
function write(pen, text, halo) {
  const [, x, y, angle] = /translate\((\S+) (\S+)\) rotate\((\S+)\)/.exec(text.getAttribute("transform") ?? "") ?? [];
  pen.translate(Number(x ?? number(text, "x")), Number(y ?? number(text, "y")));
  pen.rotate((Number(angle ?? 0) * Math.PI) / 180);
  const size = Number(inherited(text, "font-size"));
  const spans = [...text.children].map((span) => {
    const own = size * (span.getAttribute("font-size") ? 0.7 : 1); // an index or an exponent
    pen.font = `${text.getAttribute("font-weight") ?? ""} ${own}px ${inherited(text, "font-family")}`;
    const said = span.textContent ?? "";
    const down = own * Number.parseFloat(span.getAttribute("dy") ?? "0");
    return { said, down, font: pen.font, width: pen.measureText(said).width };
  });
  const anchor = { middle: 0.5, end: 1 }[text.getAttribute("text-anchor") ?? ""] ?? 0;
  pen.translate(-anchor * spans.reduce((sum, { width }) => sum + width, 0), 0);
  for (const { said, down, font, width } of spans) {
    pen.font = font;
    pen.translate(0, down);
    if (halo) pen.strokeText(said, 0, 0);
    pen.fillText(said, 0, 0);
    pen.translate(width, 0);
  }
}
