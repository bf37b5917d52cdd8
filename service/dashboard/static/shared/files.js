// Tables that the reader takes along: CSV after RFC 4180, and XLSX, a zip of four small XML files, numbers as numbers.

import { readText } from "./api.js";
import { button, h, saveBlob } from "./dom.js";

/**
 * A table of the API as links that save it. With a key a plain link would be refused: the page fetches it as everything else.
 * @param {string} name of the file
 * @param {string} address of the CSV
 */
export function files(name, address) {
  const csv = async (/** @type {Event} */ event) => {
    event.preventDefault();
    saveBlob(`${name}.csv`, new Blob([await readText(address)], { type: "text/csv" }));
  };
  const xlsx = async () => saveTable(`${name}.xlsx`, parsed(await readText(address)));
  return h("span.saved", h("a", { href: address, onclick: csv }, "CSV"), " ", button("XLSX", xlsx, { class: "link" }));
}

/** @type {(name: string, rows: Cell[][]) => HTMLElement} the first row is the header; `name`: of the file */
export function rowFiles(name, rows) {
  const link = (/** @type {string} */ format) =>
    button(format.toUpperCase(), () => saveTable(`${name}.${format}`, rows), { class: "link" });
  return h("span.saved", link("csv"), link("xlsx"));
}

/** @type {(name: string, rows: Cell[][]) => void} the first row is the header; the name's ending is the format */
export function saveTable(name, rows) {
  if (name.endsWith(".xlsx")) return saveBlob(name, xlsxOf(rows));
  const text = rows.map((row) => row.map(quoted).join(",")).join("\r\n");
  return saveBlob(name, new Blob([`${text}\r\n`], { type: "text/csv" }));
}

/**
 * A field after RFC 4180; a name that a spreadsheet would run as a formula is kept from it.
 * @param {Cell} value
 */
function quoted(value) {
  if (value === null || value === undefined) return "";
  const text = typeof value === "string" && /^[=+\-@\t\r]/.test(value) ? `'${value}` : String(value);
  return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}

/** @type {(csv: string) => Cell[][]} the cells of a CSV; what reads as a number is one */
export function parsed(csv) {
  /** @type {Cell[][]} */
  const rows = [[]];
  for (const [, quotes, plain, end] of csv.matchAll(/(?:"((?:[^"]|"")*)"|([^",\r\n]*))(,|\r?\n|$)/g)) {
    const text = quotes === undefined ? plain : quotes.replaceAll('""', '"');
    const number = quotes === undefined && /^-?\d+(\.\d+)?([eE][+-]?\d+)?$/.test(text);
    rows[rows.length - 1].push(number ? Number(text) : text);
    if (end === "") break;
    if (end !== ",") rows.push([]);
  }
  return rows.filter((row) => row.length > 1 || row[0] !== "");
}

const HEAD = '<?xml version="1.0" encoding="UTF-8" standalone="yes"?>\n';
const OFFICE = "http://schemas.openxmlformats.org";
const TYPE = "application/vnd.openxmlformats-officedocument.spreadsheetml";
/** All of the file but the rows. */
const PARTS = {
  "[Content_Types].xml": `<Types xmlns="${OFFICE}/package/2006/content-types"><Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/><Override PartName="/xl/workbook.xml" ContentType="${TYPE}.sheet.main+xml"/><Override PartName="/xl/sheet.xml" ContentType="${TYPE}.worksheet+xml"/></Types>`,
  "_rels/.rels": `<Relationships xmlns="${OFFICE}/package/2006/relationships"><Relationship Id="r1" Type="${OFFICE}/officeDocument/2006/relationships/officeDocument" Target="xl/workbook.xml"/></Relationships>`,
  "xl/workbook.xml": `<workbook xmlns="${OFFICE}/spreadsheetml/2006/main" xmlns:r="${OFFICE}/officeDocument/2006/relationships"><sheets><sheet name="Data" sheetId="1" r:id="r1"/></sheets></workbook>`,
  "xl/_rels/workbook.xml.rels": `<Relationships xmlns="${OFFICE}/package/2006/relationships"><Relationship Id="r1" Type="${OFFICE}/officeDocument/2006/relationships/worksheet" Target="sheet.xml"/></Relationships>`,
};

/** @param {string} text */
const escaped = (text) =>
  // oxlint-disable-next-line no-control-regex
  text
    .replaceAll(/[\u0000-\u0008\u000b\u000c\u000e-\u001f]/g, "")
    .replaceAll("&", "&amp;")
    .replaceAll("<", "&lt;");

/** @param {Cell} value */
function cell(value) {
  if (value === null || value === undefined || value === "") return "<c/>";
  if (typeof value === "number" && Number.isFinite(value)) return `<c><v>${value}</v></c>`;
  return `<c t="inlineStr"><is><t xml:space="preserve">${escaped(String(value))}</t></is></c>`;
}

/** @param {Cell[][]} rows */
function xlsxOf(rows) {
  const lines = rows.map((row) => `<row>${row.map(cell).join("")}</row>`).join("");
  const sheet = `<worksheet xmlns="${OFFICE}/spreadsheetml/2006/main"><sheetData>${lines}</sheetData></worksheet>`;
  return new Blob(zipped({ ...PARTS, "xl/sheet.xml": sheet }), { type: `${TYPE}.sheet` });
}

/** @type {(parts: Record<string, string>) => Uint8Array<ArrayBuffer>[]} texts as a zip file, not compressed */
function zipped(parts) {
  const encoder = new TextEncoder();
  /** @type {Uint8Array<ArrayBuffer>[]} */
  const local = [];
  /** @type {Uint8Array<ArrayBuffer>[]} */
  const central = [];
  let offset = 0;
  for (const [path, text] of Object.entries(parts)) {
    const [name, data] = [encoder.encode(path), encoder.encode(HEAD + text)];
    // version, flags, method, time, date; checksum, sizes; lengths of the name and of nothing more
    const shared = [20, 0, 0, 0, 33, crc32(data), data.length, data.length, name.length, 0];
    const head = bytes([4, ...SHARED], [0x04034b50, ...shared]);
    const listed = bytes([4, 2, ...SHARED, 2, 2, 2, 4, 4], [0x02014b50, 20, ...shared, 0, 0, 0, 0, offset]);
    central.push(listed, name);
    local.push(head, name, data);
    offset += head.length + name.length + data.length;
  }
  const size = central.reduce((sum, part) => sum + part.length, 0);
  const { length: count } = Object.keys(parts);
  const end = bytes([4, 2, 2, 2, 2, 4, 4, 2], [0x06054b50, 0, 0, count, count, size, offset, 0]);
  return [...local, ...central, end];
}

/** Bytes of the numbers that both of a file's headers hold. */
const SHARED = [2, 2, 2, 2, 2, 4, 4, 4, 2, 2];

/** @type {(sizes: number[], values: number[]) => Uint8Array<ArrayBuffer>} numbers in as many bytes as each takes, the least first */
function bytes(sizes, values) {
  return new Uint8Array(
    values.flatMap((value, index) => Array.from({ length: sizes[index] }, (_, n) => (value >>> (8 * n)) & 255)),
  );
}

const TABLE = Uint32Array.from({ length: 256 }, (_, n) => {
  let c = n;
  for (let bit = 0; bit < 8; bit += 1) c = c & 1 ? 0xedb88320 ^ (c >>> 1) : c >>> 1;
  return c >>> 0;
});

/** @param {Uint8Array} data */
function crc32(data) {
  let c = 0xffffffff;
  for (const byte of data) c = TABLE[(c ^ byte) & 255] ^ (c >>> 8);
  return (c ^ 0xffffffff) >>> 0;
}
