"""Files as public programs write them, each with the channels that it holds: what a person who opens it would say.

The names, units, separators and title blocks follow the manuals and example files of the programs (catman, DIAdem, LabVIEW,
Dewesoft, MoTeC, TestSuite, PicoLog, Graphtec, Hioki, TwinCAT, CANape, historians), the spreadsheets of four languages and
the scripts of test engineers.
"""

import csv
import io
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np
import openpyxl  # type: ignore[import-untyped]
import pandas as pd  # type: ignore[import-untyped]
import scipy.io
from nptdms import ChannelObject, TdmsWriter  # type: ignore[import-untyped]

from models.arrays import FloatArray


@dataclass(frozen=True, kw_only=True)
class Column:
    """A column: its name in the file, its unit (None: it states none), its values as written, and the channel that they
    are."""

    name: str
    unit: str | None
    values: Sequence[object]
    channel: str | None = None


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """A file's name and the columns, the kind and the channels (in their own units) that it holds; what made it."""

    path: Path
    kind: str
    truth: Mapping[str, FloatArray]
    writer: str
    language: str


@dataclass(frozen=True, kw_only=True)
class Sheet:
    """What a program is to write."""

    columns: list[Column]
    language: str
    block: list[tuple[str, str]] = field(default_factory=list)
    decimals: int = 3


#: Language -> what rigs call their channels, their `units`, and what stands `beside` them.
TITLES = tomllib.loads(Path(__file__).with_name("titles.toml").read_text(encoding="utf-8"))
#: Factors from the channels' units (bar, rpm, Nm, °C, s) to others; 1 where there is none.
FACTORS: dict[str, float] = TITLES.pop("factors")


# --- tests ---


def _friction(pressure: FloatArray, speed: FloatArray, rng: np.random.Generator) -> FloatArray:
    level = 4.1 * (0.8 + 0.35 * np.exp(-np.abs(speed) / 150) + speed * 2e-5)
    return np.asarray(np.sign(speed + 1e-9) * pressure * level * (1 + 0.002 * rng.standard_normal(speed.size)))


def test_of(kind: str, sampled: bool, rng: np.random.Generator) -> dict[str, FloatArray]:
    """The channels of a test in their own units: plateaus, a record of plateaus, or oscillating speeds."""
    pressures = np.sort(rng.choice([2.0, 3.0, 4.0, 5.0, 6.0, 8.0], size=rng.integers(1, 4), replace=False))
    if kind == "stationary_stribeck":
        speeds = np.array([20, 50, 120, 220, 420, 720, 1020, 1520, 1970], dtype=float)
        pressure, speed = np.repeat(pressures, speeds.size), np.tile(speeds, pressures.size)
        if sampled:
            pressure, speed = np.repeat(pressure, 150), np.repeat(speed, 150)
    else:
        seconds = np.arange(2000) * 0.01
        pressure, speed = np.full(2000, pressures[0]), 300 + 280 * np.sin(2 * np.pi * 0.25 * seconds)
    noisy = sampled or kind != "stationary_stribeck"
    pressure = pressure * (1 + 0.001 * rng.standard_normal(pressure.size) * noisy)
    speed = speed + 0.4 * rng.standard_normal(speed.size) * noisy
    channels = {"pressure_bar": pressure, "speed_rpm": speed, "torque_nm": _friction(pressure, speed, rng)}
    if noisy:
        channels = {"time_s": np.round(np.arange(speed.size) * 0.01, 4)} | channels
    if rng.random() < 0.5:
        channels["oil_temperature_c"] = 80 + rng.standard_normal(speed.size).cumsum() * 0.01
    return channels


def columns_of(
    channels: Mapping[str, FloatArray], language: str, rng: np.random.Generator, *, units: bool = True
) -> list[Column]:
    """The channels as the columns of a program of that language, in units of its users, with others beside them."""
    columns = []
    for channel, values in channels.items():
        unit = str(rng.choice(TITLES[language]["units"][channel])) if units or rng.random() < 0.3 else None
        written = values * FACTORS.get(unit, 1.0) if unit else values
        name = str(rng.choice(TITLES[language][channel]))
        columns.append(Column(name=name, unit=unit, values=written.tolist(), channel=channel))
    size = len(columns[0].values)
    beside = list(TITLES[language]["beside"].items())
    for at in rng.permutation(len(beside))[: rng.integers(0, 4)]:
        name, (unit, value) = beside[at]
        more = value * (1 + 0.003 * rng.standard_normal(size)) if unit else np.arange(1, size + 1)
        columns.append(Column(name=name, unit=unit or None, values=more.tolist()))
    first = [column for column in columns if column.channel == "time_s"]
    others = [column for column in columns if column.channel != "time_s"]
    return first + [others[at] for at in rng.permutation(len(others))]


def _text(value: object, decimals: int, decimal: str) -> str:
    return (f"{value:.{decimals}f}" if isinstance(value, float) else str(value)).replace(".", decimal)


def _lines(sheet: Sheet, separator: str, decimal: str, ending: str = "\n") -> str:
    rows = zip(*(column.values for column in sheet.columns), strict=True)
    return "".join(separator.join(_text(value, sheet.decimals, decimal) for value in row) + ending for row in rows)


# --- programs ---


def spreadsheet_csv(folder: Path, sheet: Sheet, rng: np.random.Generator) -> Path:
    """`Save as CSV` of a spreadsheet: in Europe semicolons, decimal commas and the system's encoding."""
    european = sheet.language in ("de", "fr", "it")
    separator, decimal = (";", ",") if european else (",", ".")
    form = str(
        rng.choice(["{} [{}]", "{} ({})", "{} in {}"] if sheet.language in ("en", "de") else ["{} ({})", "{} [{}]"])
    )
    block = "".join(f"{label}{separator}{value}\n" for label, value in sheet.block) + ("\n" if sheet.block else "")
    in_row = rng.random() < 0.3
    titles = [c.name if in_row or c.unit is None else form.format(c.name, c.unit) for c in sheet.columns]
    units = separator.join(c.unit or "" for c in sheet.columns) + "\n" if in_row else ""
    text = block + separator.join(titles) + "\n" + units + _lines(sheet, separator, decimal)
    encoding = {"ja": "shift_jis", "zh": "gbk"}.get(sheet.language, "cp1252") if rng.random() < 0.6 else "utf-8-sig"
    path = folder / "export.csv"
    path.write_bytes(text.replace("\n", "\r\n").encode(encoding, "replace"))
    return path


def pandas_csv(folder: Path, sheet: Sheet, rng: np.random.Generator) -> Path:
    """A script of an engineer: snake case with the unit behind, an index or none."""
    names = [f"{c.name}_{c.unit}" if c.unit and rng.random() < 0.8 else c.name for c in sheet.columns]
    names = [name.replace(" ", "_").lower() if rng.random() < 0.5 else name for name in names]
    frame = pd.DataFrame({name: c.values for name, c in zip(names, sheet.columns, strict=True)}).round(sheet.decimals)
    path = folder / "run.csv"
    frame.to_csv(path, index=bool(rng.random() < 0.4))
    return path


def catman_ascii(folder: Path, sheet: Sheet, _: np.random.Generator) -> Path:
    """catman's ASCII export: a title block, names, units and sensors over tab-separated columns."""
    rate = "Abtastrate:\t100 Hz\n" if sheet.columns[0].channel == "time_s" else ""
    block = f"CATMAN\tHBM\nDATEI: C:\\Messung\\lauf.bin\nAnzahl Kanäle:\t{len(sheet.columns)}\n{rate}\n"
    head = ["\t".join(c.name for c in sheet.columns), "\t".join(f"[{c.unit}]" if c.unit else "" for c in sheet.columns)]
    sensors = "\t".join(f"SG{at} T12" for at, _ in enumerate(sheet.columns))
    path = folder / "lauf.asc"
    path.write_bytes(
        (block + "\n".join([*head, sensors]) + "\n" + _lines(sheet, "\t", ",")).encode("cp1252", "replace")
    )
    return path


def labview_lvm(folder: Path, sheet: Sheet, _: np.random.Generator) -> Path:
    """LabVIEW's measurement file."""
    timed = sheet.columns[0].channel == "time_s" and sheet.columns[0].unit in ("s", "sec")
    columns = sheet.columns[1:] if timed else sheet.columns
    count = len(columns)
    head = {"Channels": [str(count)], "Samples": [str(len(columns[0].values))] * count}
    head |= {"Y_Unit_Label": [c.unit or "" for c in columns], "X_Dimension": ["Time"] * count}
    head |= {"Delta_X": ["0.01" if timed else "1.0"] * count}
    lines = ["LabVIEW Measurement\t", "Writer_Version\t2", "Separator\tTab", "Decimal_Separator\t."]
    lines += [f"X_Columns\t{'One' if timed else 'No'}", "***End_of_Header***\t", ""]
    lines += ["\t".join([label, *cells]) for label, cells in head.items()]
    lines += ["***End_of_Header***", "\t".join(["X_Value", *(c.name for c in columns), "Comment"])]
    first = sheet.columns[0].values if timed else [""] * len(columns[0].values)
    rows = zip(first, *(c.values for c in columns), strict=True)
    body = "\n".join("\t".join(_text(value, sheet.decimals, ".") for value in row) for row in rows)
    path = folder / "test.lvm"
    path.write_text("\n".join(lines) + "\n" + body + "\n", encoding="utf-8")
    return path


def instrument_csv(folder: Path, sheet: Sheet, rng: np.random.Generator) -> Path:
    """CSV of test machines and loggers: quoted titles with their units behind a comma, or in a second row."""
    names = [f"{c.name}, {c.unit}" if c.unit else c.name for c in sheet.columns]
    two_rows = rng.random() < 0.5
    out = io.StringIO()
    writer = csv.writer(out, quoting=csv.QUOTE_ALL)
    for label, value in sheet.block:
        writer.writerow([label, value])
    if sheet.block:
        writer.writerow([])
    writer.writerow([c.name for c in sheet.columns] if two_rows else names)
    if two_rows:
        writer.writerow([c.unit or "" for c in sheet.columns])
    quoted = rng.random() < 0.5
    for row in zip(*(c.values for c in sheet.columns), strict=True):
        cells = [_text(value, sheet.decimals, ".") for value in row]
        out.write((",".join(f'"{cell}"' for cell in cells) if quoted else ",".join(cells)) + "\r\n")
    path = folder / "specimen.csv"
    path.write_text(out.getvalue(), encoding="utf-8", newline="")
    return path


def numpy_text(folder: Path, sheet: Sheet, rng: np.random.Generator) -> Path:
    """numpy.savetxt with a header."""
    names = [f"{c.name.replace(' ', '_')}[{c.unit}]" if c.unit else c.name.replace(" ", "_") for c in sheet.columns]
    path = folder / "data.txt"
    table = np.array([c.values for c in sheet.columns], dtype=float).T
    np.savetxt(path, table, header=" ".join(names), fmt=str(rng.choice(["%.6e", "%.7f"])), encoding="utf-8")
    return path


def excel(folder: Path, sheet: Sheet, rng: np.random.Generator) -> Path:
    """A workbook with a title block, a row of units or units in the titles, and a sheet of notes."""
    book = openpyxl.Workbook()
    page = book.active
    page.title = {"de": "Messung", "fr": "Mesure"}.get(sheet.language, "Data")
    for label, value in sheet.block:
        page.append([label, int(value) if value.isdigit() else value])
    if sheet.block:
        page.append([])
    in_row = rng.random() < 0.5
    page.append([c.name if in_row or c.unit is None else f"{c.name} [{c.unit}]" for c in sheet.columns])
    if in_row:
        page.append([c.unit for c in sheet.columns])
    for row in zip(*(c.values for c in sheet.columns), strict=True):
        page.append([round(value, sheet.decimals + 1) if isinstance(value, float) else value for value in row])
    if rng.random() < 0.4:
        book.create_sheet("Notes").append(["oil changed before the test"])
    path = folder / "report.xlsx"
    book.save(path)
    return path


def tdms(folder: Path, sheet: Sheet, rng: np.random.Generator) -> Path:
    """A TDMS file with a waveform's clock or a channel of times."""
    waveform = sheet.columns[0].channel == "time_s" and rng.random() < 0.6
    columns = sheet.columns[1:] if waveform else sheet.columns
    properties = {"wf_increment": 0.01, "wf_start_offset": 0.0} if waveform else {}
    path = folder / "measurement.tdms"
    with TdmsWriter(path) as writer:
        held = [
            ChannelObject(
                "Untitled",
                c.name,
                np.array(c.values, dtype=float),
                properties=properties | ({"unit_string": c.unit} if c.unit else {}),
            )
            for c in columns
        ]
        writer.write_segment(held)
    return path


def matlab(folder: Path, sheet: Sheet, rng: np.random.Generator) -> Path:
    """Variables of a workspace, or a struct of signals with their units."""
    names = [
        "".join(ch if ch.isalnum() and ch.isascii() else "_" for ch in c.name).strip("_") or f"ch{at}"
        for at, c in enumerate(sheet.columns)
    ]
    if rng.random() < 0.6:
        held: dict[str, object] = {
            "data": {
                n: {"value": np.array(c.values, dtype=float), "unit": c.unit or ""}
                for n, c in zip(names, sheet.columns, strict=True)
            }
        }
    else:
        held = {
            f"{n}_{''.join(ch for ch in (c.unit or '') if ch.isalnum())}".strip("_"): np.array(c.values, dtype=float)
            for n, c in zip(names, sheet.columns, strict=True)
        }
    path = folder / "workspace.mat"
    scipy.io.savemat(path, held)
    return path


def hdf5(folder: Path, sheet: Sheet, rng: np.random.Generator) -> Path:
    """A group of data sets with their units as attributes."""
    path = folder / "log.h5"
    with h5py.File(path, "w") as file:
        group = file.create_group("measurement")
        for column in sheet.columns:
            held = group.create_dataset(column.name.replace("/", " "), data=np.array(column.values, dtype=float))
            if column.unit:
                held.attrs[str(rng.choice(["unit", "units"]))] = column.unit
    return path


def historian(folder: Path, sheet: Sheet, _: np.random.Generator) -> Path:
    """A table of tag, time and value, as databases of plants export it."""
    columns = [c for c in sheet.columns if c.channel != "time_s"]
    lines = ["Timestamp,Tag,Value,Unit"]
    for row in range(len(columns[0].values)):
        moment = pd.Timestamp("2026-11-02 07:00:00") + pd.Timedelta(seconds=row * 0.01)
        lines += [
            f"{moment:%Y-%m-%d %H:%M:%S.%f},{c.name},{_text(c.values[row], sheet.decimals, '.')},{c.unit or ''}"
            for c in columns
        ]
    path = folder / "history.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


WRITERS: dict[str, tuple[Callable[[Path, Sheet, np.random.Generator], Path], tuple[str, ...], float]] = {
    "spreadsheet CSV": (spreadsheet_csv, ("en", "de", "fr", "it", "ja", "zh"), 4),
    "script's CSV": (pandas_csv, ("en", "de"), 2),
    "catman ASCII": (catman_ascii, ("de", "en"), 1),
    "LabVIEW LVM": (labview_lvm, ("en", "de"), 1),
    "machine's CSV": (instrument_csv, ("en", "de", "fr"), 3),
    "savetxt": (numpy_text, ("en", "de"), 1),
    "XLSX": (excel, ("en", "de", "fr", "it", "zh"), 3),
    "TDMS": (tdms, ("en", "de"), 1.5),
    "MATLAB": (matlab, ("en", "de"), 1),
    "HDF5": (hdf5, ("en", "de"), 1),
    "historian": (historian, ("en", "de"), 0.7),
}


def drawn(folder: Path, rng: np.random.Generator) -> Drawn:
    """One file."""
    names = list(WRITERS)
    weights = np.array([WRITERS[name][2] for name in names])
    writer = names[int(rng.choice(len(names), p=weights / weights.sum()))]
    write, languages, _ = WRITERS[writer]
    usual = [language for language in languages for _ in range(3 if language in ("en", "de") else 1)]
    language = str(rng.choice(usual))
    kind = "stationary_stribeck" if rng.random() < 0.7 else "dynamic_stribeck"
    sampled = kind == "dynamic_stribeck" or writer == "historian" or rng.random() < 0.4
    channels = test_of(kind, sampled, rng)
    columns = columns_of(channels, language, rng, units=rng.random() < 0.85)
    cycles = int(rng.integers(0, 40)) * 500
    labels = {
        "de": [("Prüfling", "KL-4712"), ("Lastspiele", str(cycles))],
        "en": [("Operator", "JS"), ("Cycle count", str(cycles))],
    }
    block = labels.get(language, []) if rng.random() < 0.5 else []
    path = write(folder, Sheet(columns=columns, language=language, block=block, decimals=7), rng)
    return Drawn(path=path, kind=kind, truth=channels, writer=writer, language=language)
