"""Files as libraries and programs write them, each with the numbers that it must give or the words that refuse it.

All hold the same record or the same plateaus; what differs is how it is written.
"""

import contextlib
import io
import json
import re
import zipfile
from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import openpyxl  # type: ignore[import-untyped]
import pandas as pd  # type: ignore[import-untyped]
import pyarrow as pa  # type: ignore[import-untyped]
import pyarrow.parquet as parquet  # type: ignore[import-untyped]
import pytest
import scipy.io
import xlsxwriter  # type: ignore[import-untyped]
from hypothesis import given, settings
from hypothesis import strategies as st
from nptdms import ChannelObject, TdmsWriter  # type: ignore[import-untyped]

from service.channels import CHANNELS
from service.errors import InvalidError, TooLargeError
from service.readers import hdf5 as hdf5_reader
from service.readers.assemble import Channels, to_channels
from service.readers.limits import LIMITS
from service.readers.read_file import preview_file, read_file
from service.readers.table import Reading
from service.readers.unit_table import UNITS
from service.runs.suggestion import suggestion_of
from tests.service.readers.sample_files import read_content

ROWS = 12
TIME = np.round(np.arange(ROWS) * 0.01, 2)
RECORD = {
    "time_s": TIME,
    "pressure_bar": np.round(5 + 0.01 * TIME, 4),
    "speed_rpm": np.round(np.linspace(20, 1970, ROWS), 2),
    "torque_nm": np.round(np.linspace(21, 19, ROWS), 4),
}
NAMES = {"time_s": "Zeit [s]", "pressure_bar": "Druck [bar]", "speed_rpm": "Drehzahl [1/min]", "torque_nm": "M [Nm]"}
PLATEAUS = ["pressure_bar", "speed_rpm", "torque_nm"]


def rows(separator: str = ",", decimal: str = ".", names: list[str] | None = None, number: str = "%.4f") -> str:
    """The record's rows, a line each."""
    table = zip(*(RECORD[name].tolist() for name in names or RECORD), strict=True)
    lines = [separator.join((number % value).replace(".", decimal) for value in row) for row in table]
    return "\n".join(lines) + "\n"


def each(line: Callable[[float, float, float, float], str]) -> str:
    """A line for each row of the record."""
    return "".join(line(*row) + "\n" for row in zip(*RECORD.values(), strict=True))


def frame() -> pd.DataFrame:
    return pd.DataFrame(RECORD)


def savetxt(**how: str) -> bytes:
    """What numpy.savetxt writes."""
    held = io.BytesIO()
    np.savetxt(held, np.c_[*RECORD.values()], **how)  # type: ignore[arg-type]
    return held.getvalue()


def grouped(sign: str, decimal: str, quote: str = "") -> str:
    """The record's rows with thousands grouped."""
    marks = str.maketrans(",.", sign + decimal)
    separator = "," if quote else ";"
    table = zip(*RECORD.values(), strict=True)
    lines = [separator.join(f"{quote}{f'{v:,.4f}'.translate(marks)}{quote}" for v in row) for row in table]
    return "\n".join(lines) + "\n"


def stamps(form: str, first: datetime = datetime(2026, 11, 2, 7)) -> str:
    moments = [(first + timedelta(seconds=float(time))).strftime(form) for time in TIME]
    lines = [f"{at},{line}" for at, line in zip(moments, rows(names=PLATEAUS).splitlines(), strict=True)]
    return "\n".join(["timestamp," + ",".join(PLATEAUS), *lines]) + "\n"


def long(titles: str, form: str) -> str:
    """A row for each value, by time."""
    shown = {"pressure_bar": ("Pressure", "bar"), "speed_rpm": ("Speed", "rpm"), "torque_nm": ("Torque", "Nm")}
    lines = [
        form.format(t=t, ms=1000 * t, channel=channel, name=name, unit=unit, value=RECORD[channel][row])
        for row, t in enumerate(TIME)
        for channel, (name, unit) in shown.items()
    ]
    return "\n".join([titles, *lines]) + "\n"


HEAD = ",".join(RECORD)
GERMAN = ";".join(NAMES.values())
#: Name of the file -> its text.
TEXTS: dict[str, str | bytes] = {
    "pandas.csv": frame().to_csv(),
    "pandas-semicolon.csv": frame().to_csv(sep=";", decimal=",", index=False),
    "pandas-tabs.txt": frame().to_csv(sep="\t", index=False),
    "pandas-string.txt": frame().to_string(index=False),
    "pandas-dates.csv": stamps("%Y-%m-%d %H:%M:%S.%f"),
    "iso.csv": stamps("%Y-%m-%dT%H:%M:%S.%f"),
    "zone.csv": stamps("%Y-%m-%dT%H:%M:%S.%f+01:00"),
    "german-dates.csv": stamps("%d.%m.%Y %H:%M:%S.%f"),
    "american-dates.csv": stamps("%m/%d/%Y %I:%M:%S.%f %p"),
    "matlab-dates.csv": stamps("%d-%b-%Y %H:%M:%S.%f"),
    "times-of-day.csv": stamps("%H:%M:%S.%f"),
    "timedelta.csv": frame().assign(time_s=lambda f: pd.to_timedelta(f.time_s, unit="s").astype(str)).to_csv(),
    "savetxt.txt": savetxt(header=" ".join(RECORD)),
    "savetxt-commas.csv": savetxt(delimiter=",", header=HEAD, comments=""),
    "savetxt-g.csv": savetxt(fmt="%g", delimiter=";", header=HEAD.replace(",", ";")),
    "fixed-width.txt": "  ".join(f"{name:>14}" for name in RECORD) + "\n" + rows("        "),
    "units-in-brackets-and-blanks.txt": "t [s]  p [bar]  n [rpm]  M [Nm]\n" + rows("   "),
    "bars.txt": HEAD.replace(",", "|") + "\n" + rows("|"),
    "latin.csv": (GERMAN.replace("M [Nm]", "Drehmoment [N·m]") + "\n" + rows(";", ",")).encode("cp1252"),
    "utf16.txt": (GERMAN.replace(";", "\t") + "\n" + rows("\t", ",")).encode("utf-16"),
    "utf8-bom.csv": (GERMAN + "\n" + rows(";", ",")).encode("utf-8-sig"),
    "gbk.csv": ("时间(s),压力(bar),转速(rpm),扭矩(Nm)\n" + rows()).encode("gbk"),
    "sjis.csv": ("時間 (s),圧力 (bar),回転数 (rpm),トルク (Nm)\n" + rows()).encode("shift_jis"),
    "cyrillic.csv": ("время [s];давление [bar];обороты [rpm];момент [Nm]\n" + rows(";", ",")).encode("cp1251"),
    "unit-row.csv": "Zeit;Druck;Drehzahl;Drehmoment\ns;bar;1/min;Nm\n" + rows(";", ","),
    "unit-row-brackets.csv": "Zeit;Druck;Drehzahl;Drehmoment\n[s];[bar];[1/min];[Nm]\n" + rows(";", ","),
    "unit-row-above.csv": "s;bar;1/min;Nm\nZeit;Druck;Drehzahl;Drehmoment\n" + rows(";", ","),
    "header-block.csv": "Prüfstand 3\nPrüfer;Meier\nDatum;2.11.26\nLasten;7000\n\n" + GERMAN + "\n" + rows(";", ","),
    "colons-above.txt": "Operator: Meier\nGain: 2.0\nSamples: 12\n\n" + HEAD.replace(",", "\t") + "\n" + rows("\t"),
    "numbers-above.csv": "Offset,1,2,3\nGain,1,1,1\nend of header\n" + HEAD + "\n" + rows(),
    "two-rows-of-titles.csv": ",Kupplung,,\nZeit,Druck,Drehzahl,Moment\ns,bar,rpm,Nm\n" + rows(),
    "repeated-titles.csv": HEAD + "\n" + rows().replace("0.0500,", HEAD + "\n0.0500,"),
    "remarks.csv": HEAD + ",Bemerkung\n" + rows().replace("\n", ",läuft gut; ja\n"),
    "remarks-quoted.csv": HEAD + ",Bemerkung\n" + rows().replace("\n", ',"ein, zwei\nund drei"\n'),
    "comma-units.csv": "Time, s;Pressure, bar;Speed, rpm;Torque, Nm\n" + rows(";"),
    "slash-units.csv": "t / s;p / bar;n / 1/min;M / Nm\n" + rows(";", ","),
    "in-units.csv": "Zeit in s;Druck in bar;Drehzahl in 1/min;Moment in Nm\n" + rows(";", ","),
    "wide-brackets.csv": "t（s）,p［bar］,n（rpm）,M（Nm）\n" + rows(),
    "line-break-in-title.csv": '"Zeit\n[s]";"Druck\n[bar]";"Drehzahl\n[1/min]";"Md\n[Nm]"\n' + rows(";", ","),
    "all-quoted.csv": '"' + HEAD.replace(",", '","') + '"\n' + '"' + rows('","').replace("\n", '"\n"')[:-1],
    "trailing.csv": HEAD + ",,\n" + rows().replace("\n", ",,\n"),
    "mapped.csv": "Zeit;p1;n1;Mz;x\n" + rows(";", ",").replace("\n", ";7\n"),
    "thousands-german.csv": GERMAN + "\n" + grouped(".", ","),
    "thousands-american.csv": HEAD + "\n" + grouped(",", ".", '"'),
    "thousands-swiss.csv": GERMAN + "\n" + grouped("'", "."),
    "signs.csv": HEAD + "\n" + rows().replace("\n", "\n+")[:-1].replace("0.0", ".0", 1),
    "exponents.csv": HEAD + "\n" + rows(number="%.12E"),
    "old-mac.csv": (HEAD + "\n" + rows()).replace("\n", "\r"),
    "sep.csv": "sep=;\n" + GERMAN + "\n" + rows(";", ","),
    "labview.lvm": ("LabVIEW Measurement\t\nDecimal_Separator\t,\nX_Columns\tOne\nTime\t08:00\n***End_of_Header***\t\n\t\n"
                    "Channels\t3\t\t\t\nY_Unit_Label\tbar\trpm\tNm\t\nX0\t0,0\t0,0\t0,0\t\nDelta_X\t0,01\t0,01\t0,01\t\n"
                    "***End_of_Header***\t\t\t\t\nX_Value\tDruck\tDrehzahl\tMoment\tComment\n" + rows("\t", ",")),
    "labview-without-times.lvm": ("LabVIEW Measurement\t\nX_Columns\tNo\n***End_of_Header***\t\n\t\nChannels\t3\n"
                                  "Y_Unit_Label\tbar\trpm\tNm\nX0\t0.0\t0.0\t0.0\nDelta_X\t0.01\t0.01\t0.01\n"
                                  "***End_of_Header***\nX_Value\tDruck\tDrehzahl\tMoment\tComment\n\t"
                                  + rows("\t", names=PLATEAUS).replace("\n", "\n\t")[:-1]),
    "diadem.csv": ("TITLE;x\n"
                   "ChannelName;Zeit;Druck;Drehzahl;Moment\nUnit;s;bar;1/min;Nm\nLength;12;12;12;12\nMaximum;1;5;1970;21\n"
                   ";" + rows(";", ",").replace("\n", "\n;")[:-1]),
    "dewesoft.csv": ("Start time:,2026/11/02 08:00\nSample rate:,100\n\n"
                     "Time (s),p/AVE (bar),n/AVE (rpm),M/AVE (Nm)\n" + rows()),
    "viewer.csv": '"timestamps","p [bar]","n [rpm]","M [Nm]"\n' + rows(),
    "french.csv": ("Temps (s);Pression (bar);Vitesse (tr/min);Couple (N.m)\n" + rows(";", ",")).encode("cp1252"),
    "spanish.csv": ("Tiempo;Presión;Velocidad;Par\ns;bar;rpm;N·m\n" + rows(";", ",")).encode("cp1252"),
    "japanese.csv": ("時間[s],圧力[bar],回転数[min-1],トルク[N・m]\n" + rows()).encode("shift_jis"),
    "japanese-euc.csv": ("時間[s],圧力[bar],回転数[rpm],トルク[Nm]\n" + rows()).encode("euc_jp"),
    "japanese-wide.csv": "時刻 [ｓ],圧力 [ｂａｒ],回転数 [ｒｐｍ],トルク [Ｎｍ]\n" + rows(),
    "chinese-slash.csv": "时间/s,压力/bar,转速/(r/min),扭矩/(N·m)\n" + rows(),
    "chinese-units.csv": ("时间（秒）,油压（巴）,转速（转/分）,转矩（牛·米）\n" + rows()).encode("gbk"),
    "taiwanese.csv": ("時間(s),壓力(bar),轉速(rpm),扭矩(N-m)\n" + rows()).encode("big5"),
    "capitals.csv": "TIME (SEC),PRESSURE (BAR),SPEED (RPM),TORQUE (N-M)\n" + rows(),
    "past-midnight.csv": stamps("%H:%M:%S.%f", datetime(2026, 11, 2, 23, 59, 59, 950_000)),
    "zone-without-colon.csv": stamps("%Y-%m-%dT%H:%M:%S.%f+0100"),
    "chinese-dates.csv": stamps("%Y年%m月%d日 %H:%M:%S.%f"),
    "thousands-french.csv": GERMAN + "\n" + grouped("\u202f", ","),
    "thousands-blanks.csv": GERMAN + "\n" + grouped(" ", ","),
    "means-below.csv": HEAD + "\n" + rows() + "\nMean,5,1000,20\nMax,5,1970,21\n",
    "means-below-numbers.csv": "Nr," + HEAD + "\n1," + rows().replace("\n", "\n1,")[:-2] + "Mean,5,5,1000,20\n",
    "words-below.csv": GERMAN + "\n" + rows(";", ",") + "Ende der Messung\nPrüfer: Meier\n",
    "minus.csv": HEAD + "\n" + rows().replace("0.0000,", "−0.0000,", 1),
    "catman.asc": (("Datum:\t02.11.2026\nAbtastrate:\t100 Hz\n\nZeit  1 - Standardmessrate\tDrehmoment\tDrehzahl\tDruck\n"
                    "[s]\t[Nm]\t[1/min]\t[bar]\nT10F\tMX840\tMX460\tP8AP\n"
                    + rows("\t", ",", ["time_s", "torque_nm", "speed_rpm", "pressure_bar"])).encode("cp1252")),
    "labels-before-each-row.txt": ("Kanal\tZeit\tDruck\tDrehzahl\tMoment\nEinheit\ts\tbar\t1/min\tNm\n"
                                   "Messrate\t100 Hz\t100 Hz\n"
                                   "Sensor\t\tP8\tT10F\tT10F\n\t" + rows("\t", ",").replace("\n", "\n\t")[:-1]),
    "oscilloscope.csv": ('"Model Name","DL950"\n"TraceName","Pressure","Speed","Torque"\n"BlockSize",12,12,12\n'
                         '"VUnit","bar","rpm","Nm"\n"HResolution",10,10,10\n"HUnit","ms","ms","ms"\n"Date","2026/11/02"\n"Time","08:00:00"\n\n,'
                         + rows(names=PLATEAUS).replace("\n", "\n,")[:-1]),
    "oscilloscope-with-places-of-memory.csv": (
        '"TraceName","Druck","Drehzahl","Moment"\n"VUnit","bar","rpm","Nm"\n"BlockSize",12,12,12\n"VDataType","IS2","IS2","IS2"\n'
        '"HResolution",0.01,0.01,0.01\n"HUnit","s","s","s"\n\n,' + rows(names=PLATEAUS).replace("\n", "\n,")[:-1]),
    "tribometer-with-a-large-t.csv": ("T,n,M,p\nsec,rpm,N*m,bar\n"
                                      + rows(names=["time_s", "speed_rpm", "torque_nm", "pressure_bar"])),
    "rate-above.csv": "Sample rate [kHz];0,1\nOperator;X\n\np [bar];n [rpm];M [Nm]\n" + rows(";", ",", PLATEAUS),
    "rate-in-a-comment.csv": "# Sample rate: 100 Hz\np [bar],n [rpm],M [Nm]\n" + rows(names=PLATEAUS),
    "parts-of-seconds-beside.csv": ("Datum;Uhrzeit;ms;p [bar];n [rpm];M [Nm]\n" + "".join(
        f"02.11.2026;08:00:0{int(k > 5)};{(940 + 10 * k) % 1000};{line}\n"
        for k, line in enumerate(rows(";", ",", PLATEAUS).splitlines()))),
    "the-stored-rate-of-two.csv": ("Sample rate [Hz],1000\nStorage rate [Hz],100\n\np [bar],n [rpm],M [Nm]\n"
                                   + rows(names=PLATEAUS)),
    "means-among-rows.csv": (HEAD + ",Remark\n" + rows().replace("\n", ",\n")
                             .replace("0.0600,", "0.03,5,600,20.5,average\n0.0600,")
                             .replace("0.1100,", "1 Mean,5,1500,19.5,\n0.1100,")),
    "a-status-in-words.csv": HEAD + ",Status\n" + rows().replace("\n", ",OK\n") + "0.12,5,1000,0.0,FAULT\n",
    "the-time-before-its-date.csv": stamps('"%H:%M:%S.%f 02.11.2026"'),
    "an-oil-pressure.asc": "Time  1 - default sample rate;p_Oel;n;Md\ns;bar;U/min;Nm\n" + rows(";"),
    "interval-above.csv": "Sampling interval,10ms\n\np [bar],n [rpm],M [Nm]\n" + rows(names=PLATEAUS),
    "six-rows-of-titles.csv": ("Kanal;K1;K2;K3\nZeit;Druck;Drehzahl;Moment\ns;bar;1/min;Nm\nFilter;TP 100 Hz;;\n"
                               "Ort;Kolben;Welle;Welle\n" "Sensor;P8;T10;T10\n" + rows(";", ",")),
    "numbers-of-columns.csv": "Zeit;Druck;Drehzahl;Moment\n1;2;3;4\ns;bar;1/min;Nm\n" + rows(";", ","),
    "a-rule-below-titles.txt": ("  Zeit   Druck   Drehzahl   Moment\n  [s]    [bar]    [rpm]   [Nm]\n"
                                " ------  ------  ------  ------\n" + rows("   ")),
    "table-of-markdown.md": ("| t [s] | p [bar] | n [rpm] | M [Nm] |\n|---|---|---|---|\n| "
                             + rows(" | ").replace("\n", " |\n| ")[:-2]),
    "inch-in-a-title.csv": GERMAN + ';d [3/4"]\n' + rows(";", ",").replace("\n", ";7\n"),
    "signs-apart.csv": HEAD + "\n" + rows().replace(",", ",+  "),
    "fortran.txt": HEAD.replace(",", "  ") + "\n" + rows("  ", number="%.6E").replace("E", "D"),
    "time-by-another-name.csv": ("Zeit ab Start [s];Dauer Zeit [s];Druck [bar];Drehzahl [1/min];M [Nm]\n"
                                 + re.sub(r"^([^;]*);", r"\1;4,5;", rows(";", ","), flags=re.MULTILINE)),
    "two-times-that-agree.csv": ("Timestamp;Time (ms);p [bar];n [rpm];M [Nm]\n"
                                 + "".join(f"2026-11-02 08:00:00;{1000 * float(line[:6]):.0f}{line[6:]}\n"
                                           for line in rows(";").splitlines())),
    "a-time-a-channel.csv": ("Zeit_p [s];p [bar];Zeit_n [s];n [1/min];Zeit_M [s];M [Nm]\n"
                             + each(lambda t, p, n, m: f"{t};{p};{t};{n};{t};{m}")),
    "device-behind-the-name.txt": ("time\tp_ist\\CAN:1\tn_ist\\CAN:1\tm_ist\\CAN:1\ns\tbar\trpm\tNm\n"
                               "f8\tf8\tf8\tf8\n" + rows("\t")),
    "labview-of-several-times.lvm": (
        "LabVIEW Measurement\nX_Columns\tMulti\n***End_of_Header***\n\nChannels\t3\nY_Unit_Label\tbar\trpm\tNm\n"
        "X_Dimension\tTime\tTime\tTime\n***End_of_Header***\nX_Value\tPressure\tX_Value\tSpeed\tX_Value\tTorque\tComment\n"
        + each(lambda t, p, n, m: f"{t}\t{p}\t{t}\t{n}\t{t}\t{m}")),
    "catman-step-above-each-column.asc": (
        "Channels: 3\n\nDruck\tDrehzahl\tDrehmoment\nbar\t1/min\tNm\nT0 = 02.11.2026\tT0 = 02.11.2026\tT0 = 02.11.2026\n"
        "dt = 10 ms\tdt = 10 ms\tdt = 10 ms\n" + rows("\t", ",", PLATEAUS)),
    "catman-names-of-rates.asc": ("Zeit  1 - Standardmessrate [s]\tDruck [bar]\tDrehzahl [1/min]\tDrehmoment [Nm]\n"
                                  + rows("\t", ",")),
    "units-of-all-but-the-counter.csv": ("Nr;Zeit;Druck;Drehzahl;Moment\ns;bar;1/min;Nm\n"
        + "".join(f"{k};{line}\n" for k, line in enumerate(rows(";").splitlines()))),
    "r-write-table.txt": ('"' + '" "'.join(RECORD) + '"\n'
        + "".join(f'"{k}" {line}\n' for k, line in enumerate(rows(" ").splitlines(), 1))),
    "pandas-names-over-units.csv": ",Pressure,Speed,Torque\n,bar,rpm,Nm\ntime_s,,,\n" + rows(),
    "matlab-durations.csv": HEAD.replace("time_s", "Time") + "\n" + re.sub("(?m)^(.{6})", r"\1 sec", rows()),
    "polars-durations.csv": HEAD.replace("time_s", "Time") + "\n" + re.sub("(?m)^(.{6})", r"PT\1S", rows()),
    "long.csv": long("time_s,variable,value", "{t},{channel},{value}"),
    "long-with-units.csv": long("Signal;Zeit;Wert;Einheit", "{name};00:00:{t:05.2f};{value};{unit}"),
    "long-units-in-names.csv": long("TagName\tTime [ms]\tValue\tQuality", "{name} [{unit}]\t{ms}\t{value}\tGood"),
    "long-with-a-bad-value.csv": (long("Tag,Time [s],Value,Quality", "{channel},{t},{value},Good").replace(
            "20.0909,Good", "20.0909,Good\ntorque_nm,0.052,0,Bad")),
    "labview-of-several-dates.lvm": (
        "LabVIEW Measurement\nX_Columns\tMulti\n***End_of_Header***\n\nChannels\t3\nY_Unit_Label\tbar\trpm\tNm\n"
        "***End_of_Header***\nX_Value\tPressure\tX_Value\tSpeed\tX_Value\tTorque\tComment\n"
        + each(lambda t, *measured: "\t".join(f"02.11.2026 07:00:{t:06.3f}\t{value}" for value in measured))),
    "titles-of-two-words.txt": ("Time\tTorsional Torque\tTorsional Speed\tPiston Pressure\nsec\tN-m\trpm\tbar\n"
                                + rows("\t", names=["time_s", "torque_nm", "speed_rpm", "pressure_bar"])),
    "units-in-cells.csv": ("Zeit;Druck;Drehzahl;Drehmoment\n"
                           + re.sub("(.*);(.*);(.*);(.*)", r"\1 s;\2 bar;\3 1/min;\4 Nm", rows(";", ","))),
    "zone-by-name.csv": stamps("%d.%m.%Y %H:%M:%S.%f MEZ"),
    "zone-in-brackets.csv": stamps("%Y-%m-%dT%H:%M:%S.%f+01:00[Europe/Berlin]"),
    "german-months.csv": stamps("27. Dez. 2026 %H:%M:%S.%f"),
    "spanish-months.csv": stamps("12-ene-26 %H:%M:%S.%f").replace("timestamp", "Fecha y hora"),
    "english-months.csv": stamps('"Nov 27, 2026 %I:%M:%S.%f %p"'),
    "ranges-of-sensors.csv": "t s,p 0-16 bar,n (0...3000 1/min),Torque [±200 Nm]\n" + rows(),
    "places-in-titles.csv": "Time [s],CH1-1 Pressure [bar],Drum.n_diff [rpm],Torque @ 80 °C [Nm]\n" + rows(),
    "c-times.csv": stamps("Fri Nov 27 %H:%M:%S.%f 2026"),
    "a-multiple-among-units.csv": ("Zeit;Druck;Drehzahl;Moment\ns;bar;1/min;0,01 kNm\n"
                                   + each(lambda t, p, n, m: f"{t};{p};{n};{m / 10}")),
    "set-points.csv": ("Zeit [s];p Soll [bar];p Ist [bar];n_act [1/min];Torque (filtered)\n;;;;Nm\n"
                       + re.sub("(?m)^([^;]*);", r"\1;9;", rows(";"))),
    "thousands-of-turns.csv": ("t [s],p [bar],n / 1000 min⁻¹,M [10⁻³ kNm]\n"
                               + each(lambda t, p, n, m: f"{t},{p},{n / 1000},{m}")),
    "dates-coarser-than-the-rate-above.csv": ("Sampling interval,10ms\n\nDate&Time,p [bar],n [rpm],M [Nm]\n"
        + "2026/11/02 07:00:00," + rows(names=PLATEAUS).replace("\n", "\n2026/11/02 07:00:00,")[:-20]),
    "long-mapped.csv": long("t [s],ch,y", "{t},{channel}#1,{value}"),
}  # fmt: skip


#: The maps of those that need one.
MAPS = {
    "sjis.csv": "time_s:時間 (s),pressure_bar:圧力 (bar),speed_rpm:回転数 (rpm),torque_nm:トルク (Nm)",
    "cyrillic.csv": "time_s:время,pressure_bar:давление,speed_rpm:обороты,torque_nm:момент",
    "mapped.csv": "time_s:Zeit,pressure_bar:p1,speed_rpm:n1,torque_nm:Mz",
    "dewesoft.csv": "time_s:Time,pressure_bar:p/AVE,speed_rpm:n/AVE,torque_nm:M/AVE",
    "long-mapped.csv": "pressure_bar:pressure_bar#1,speed_rpm:speed_rpm#1,torque_nm:torque_nm#1",
}


#: Those whose titles are of another language, or known in part: they are suggested.
SUGGESTED = {
    "gbk.csv", "french.csv", "spanish.csv", "japanese.csv", "japanese-euc.csv", "japanese-wide.csv", "chinese-slash.csv",
    "chinese-units.csv", "taiwanese.csv", "an-oil-pressure.asc", "time-by-another-name.csv", "titles-of-two-words.txt",
    "spanish-months.csv", "places-in-titles.csv", "set-points.csv",
}  # fmt: skip


@pytest.mark.parametrize("name", sorted(TEXTS.keys() - SUGGESTED))
def test_a_text_gives_its_numbers(tmp_path: Path, name: str) -> None:
    assert_record(read_content(tmp_path, TEXTS[name], MAPS.get(name), name=name))


@pytest.mark.parametrize("name", sorted(SUGGESTED))
def test_a_text_is_not_read_in_silence_and_what_is_suggested_gives_its_numbers(tmp_path: Path, name: str) -> None:
    with contextlib.suppress(InvalidError):
        assert read_content(tmp_path, TEXTS[name], name=name).columns.keys() != RECORD.keys()
    suggestion = suggestion_of(tmp_path / "posted", filename=name, reading=Reading())
    assert suggestion is not None
    assert suggestion.confidence >= 0.6
    mapping = ",".join(f"{channel}:{title}" for channel, title in suggestion.map.items())
    assert_record(read_content(tmp_path, TEXTS[name], mapping, name=name, time=suggestion.time))
    first = suggestion.rows[0]
    assert [first[channel] for channel in RECORD] == pytest.approx([column[0] for column in RECORD.values()])


def assert_record(read: Channels) -> None:
    assert read.columns.keys() == RECORD.keys()
    for channel, values in RECORD.items():
        np.testing.assert_allclose(read.columns[channel], values, rtol=1e-9, atol=1e-9, err_msg=channel)


@pytest.mark.parametrize(
    ("first", "a_second", "unit"),
    [
        (1793602800000, 10**3, "ms since 1970"),
        (1793602800 * 10**9, 10**9, "ns since 1970"),
        (134380764 * 10**9, 10**7, "100 ns since 1601"),
        (639291996 * 10**9, 10**7, "100 ns since 0001"),
    ],
)
def test_counts_that_can_only_be_one_computers_are_times(tmp_path: Path, first: int, a_second: int, unit: str) -> None:
    lines = [f"{first + round(a_second * t)},{m}\n" for t, m in zip(TIME, RECORD["torque_nm"], strict=True)]
    read = read_content(tmp_path, "timestamp,M [Nm]\n" + "".join(lines))
    # what a float holds of 100 ns since the year 1
    np.testing.assert_allclose(read.columns["time_s"], TIME, atol=1.3e-5)
    (notice,) = read.notices
    assert notice.message == f"timestamp states no unit; its values were read as times in {unit}"


#: As exporters write several rates into one table: cells are empty where the slower channel has no sample.
SLOWER = [f"{line};{80 + row}" if row % 3 == 0 else f"{line};" for row, line in enumerate(rows(";").splitlines())]
SLOWER_GAP = [
    line.replace(";", ";;", 1).rpartition(";")[0] if row in (5, 6) else line for row, line in enumerate(SLOWER)
]
SLOWER_TITLE = f"{GERMAN};Öltemperatur [°C]\n"
HALF = [f"{t};{p}" for t, p in zip(TIME[::2], RECORD["pressure_bar"][::2], strict=True)] + [";"] * (ROWS // 2)
TWO_CLOCKS = long("Tag,Start time [ms],Time [s],Value", "{channel},{ms},{t},{value}").replace(",0.0,0.0,", ",9.5,0.0,")
MERGED = ["time_s", "speed_rpm", "torque_nm", "pressure_bar"]
FIVE = {"pressure_bar": [5.0] * 5, "speed_rpm": [20, 120, 520, 1020, 1970], "torque_nm": [20.9, 21.9, 21.4, 20.7, 19.9]}
UNKNOWN_UNIT = "t [s];M [10 Nm]\n0;1\n1;2\n"
THOUSANDS = "pressure_bar;speed_rpm;torque_nm\n5;800;21\n5;1.100;21\n"
TWO_TABLES = "p [bar],M [Nm]\n5,1\n\nTest 2\np [bar],M [Nm]\n5,2\n"
TWO_UNITS = "t [s];Mz;Mx [Nm]\n0;1;1\n1;2;2\n"
DAYS = "Time,pressure_bar,speed_rpm,torque_nm\n" + "".join(
    f"{0.33 + k / 86400:.12f},5,{100 + k},20\n" for k in range(ROWS)
)
#: Mapped titles of which it is not clear what unit or factor they mean.
UNCLEAR = [("MzkNm", "kNm", 1e3), ("mean kNm of 3", "kNm", 1e3), ("MomNm", "mNm", 1e-3)]
FACTORS = [("Mz x10", 0.1), ("Mz/100", 100.0), ("Mz x10 Nm", 0.1), ("Mz scaled by 100", 0.01)]
SCALED = "pressure_bar,speed_rpm,{}\n5,100,20\n5,200,19\n"
#: A text, words of its refusal, and how it is asked for.
REFUSED: list[tuple[Any, ...]] = [
    ("t [s];M\n0;21 Nm\n1;22 mNm\n", "torque_nm[1] (line 3) must be a number in Nm, as in the first row, got '22 mNm'"),
    ("t [s];M [Nm]\n0;21\n1;22 Nm\n", "torque_nm[1] (line 3) must be a number, got '22 Nm'"),
    ("t [s];M\n0;21 Nm\n1;22\n", "torque_nm[1] (line 3) must be a number in Nm, as in the first row, got '22'"),
    (UNKNOWN_UNIT, "got '10 Nm'; state it with map=torque_nm:M [UNIT]"),
    ("time;M [Nm]\n2026-10-25 02:59:59 CEST;1\n2026-10-25 02:00:00 CET;2\n", "in one zone, or each with its offset"),
    ("t [s];Torque x10 [Nm]\n0;210\n", "[x0.1 Nm], [x10 Nm] or [x1 Nm]", "torque_nm:Torque x10 [Nm]"),
    ("t [s];Drehzahl x100 [1/min]\n0;12\n", "[x0.01 1/min], [x100 1/min]"),
    ("t;M\ns;Nm\nFaktor;1;0,1\n0;210\n1;211\n", "are the values already multiplied?"),
    ("t;M\ns;Nm*10\n0;2.1\n", "'Nm*10'"),
    ("t [s];Torque A1 [Nm];Torque A2 [Nm]\n0;1;2\n", "torque_nm must be one column"),
    ("t [s];M [Nm]\n0;21\n", "must not name one column for torque_nm and pressure_bar", "torque_nm:M,pressure_bar:M"),
    (
        "t [s];p [bar];n 1 [rpm];n 2 [rpm];M [Nm]\n0;5;520;500;20\n",
        "if the columns hold the speeds of both sides, send the difference",
    ),
    (
        "Time,p [bar],n [rpm],M [Nm]\n" + "".join(f"08:00:0{k // 10},5,{k},20\n" for k in range(40)),
        "time_s does not advance in 36 of 39 steps: the clock is coarser than the rows",
    ),
    (
        "Sampling rate,1000 Hz\nThinning,1/20\n\n" + ",".join(PLATEAUS) + "\n" + rows(names=PLATEAUS),
        "one every 0.001 s, thinning = 1/20. Add a column of times",
    ),
    (
        "fs = 250 Hz\nIndex,"
        + ",".join(PLATEAUS)
        + "\n"
        + "".join(f"{5 * k},{line}\n" for k, line in enumerate(rows(names=PLATEAUS).splitlines())),
        "Index rises by 5 a row",
    ),
    (
        "Sample rate,1000 Hz\nDuration,8 s\nSamples,12\n\n" + ",".join(PLATEAUS) + "\n" + rows(names=PLATEAUS),
        "one every 0.001 s, 8 s for 12 samples",
    ),
    (
        "Channel,Gain,Offset\nPressure,0.001,0\nTorque,0.01,0\n\np [bar],M [Nm]\n3995,1731\n",
        "the line 'Gain' holds factors",
    ),
    (
        "Timestamp;Time (s);M [Nm]\n" + "".join(f"2026-11-02 08:00:0{s};{2 * s};1\n" for s in range(5)),
        "got Timestamp and Time (s); choose one with time=NAME",
    ),
    ("time_s,time_s,i\n", "time_s must be one column, got time_s and time_s"),
    (THOUSANDS, "may be 1.1 or 1100"),
    ('pressure_bar,speed_rpm,torque_nm\n5,800,21\n5,"1,100",21\n', "may be 1.1 or 1100"),
    ("t [s],M [V]\n0,1\n", "'V'"),
    ("t [s],Mz V\n0,1\n", "but the file has only", "torque_nm:Mz, V"),
    ("t [s];Kraft, kN\n0;1\n", "'kN'", "torque_nm:Kraft, kN"),
    ("t [s];n [1/s]\n0;1\n", "'1/s'"),
    (HEAD + "\n0,0,5,0,100,0,20,0\n0,1,5,0,100,0,20,0\n", "must have 4 cells"),
    ("timestamp,M [Nm]\n01/02/2026 07:00:00,1\n02/02/2026 07:00:00,2\n", "day/month"),
    ("Zeit,M [Nm]\n07:30,1\n07:31,2\n", "must be a number"),
    ("1,2,3\n4,5,6\n", "line 1 must be a header"),
    ("timestamp,M [Nm]\nMon 2 Nov,1\nTue 3 Nov,2\n", "a time such as 2026-11-02 07:00:00.5"),
    ("t [s];p [bar(a)]\n0;1\n", "'bar(a)'"),
    ("t [s];p [10 bar]\n0;1\n", "'10 bar'"),
    (
        "Datum;M [Nm]\n46000.25000012;1\n46000.25000023;2\n",
        "State the unit with map=time_s:Datum [s], or [d]",
        "time_s:Datum",
    ),
    (TWO_TABLES, "holds 2 tables"),
    (HEAD + "\n" + rows() + "\nTest 2\n" + HEAD + "\n" + rows(), "holds 2 tables"),
    (HEAD + "\n0,5,,20\n", "(line 2) must be a number, got '': fill the cell, or add missing=empty"),
    (
        long("time_s,channel,a,b", "{t},{channel},{value},1"),
        "column of values is not clear, got a, b: name one column 'value'",
    ),
    (HEAD + "\n0,5,n/a,20\n", "got 'n/a': add missing=n/a to leave out such rows"),
    (HEAD + "\n0,5,NaN,20\n", "got nan: add missing=nan to leave such rows out"),
    (HEAD + "\n" + rows() + "Mittelwert\n" + rows(), "line 14 must have 4 cells"),
    (SLOWER_TITLE + "\n".join(SLOWER_GAP), "pressure_bar[5] (line 7) must be a number, got '': fill the cell"),
    (TWO_CLOCKS, "got Start time and Time; choose one with time=NAME"),
    (TWO_UNITS, "must be kNm, as the rig profile or map says, got 'Nm'", "torque_nm:Mx [kNm]"),
    (TWO_TABLES.replace("5,1", "5,1e9"), "torque_nm[0] (line 2)", None, {"table": "1"}),
    (TWO_TABLES.replace("5,2", "5,1e9"), "torque_nm[0] (line 6)", None, {"table": "2"}),
    (DAYS, "in seconds or days", "time_s:Time"),
    *(
        (f"t [s];{title}\n0;1\n", f"may be {unit}: state it with map=torque_nm:{title} [{unit}]", f"torque_nm:{title}")
        for title, unit, _ in UNCLEAR
    ),
    *((SCALED.format(title), f"[x{factor:g} Nm]", f"torque_nm:{title}") for title, factor in FACTORS),
]


@pytest.mark.parametrize("case", REFUSED, ids=[words for _, words, *_ in REFUSED])
def test_a_text_is_refused_with_words_that_help(tmp_path: Path, case: tuple[Any, ...]) -> None:
    content, words, *asked = case
    with pytest.raises(InvalidError) as caught:
        read_content(tmp_path, content, *asked[:1], **dict(*asked[1:]))
    assert words in caught.value.detail


def marked(title: str, good: object, bad: object) -> str:
    """The record with a column that marks its fourth row invalid."""
    marks = [bad if row == 3 else good for row in range(ROWS)]
    lines = [f"{line},{mark}" for line, mark in zip(rows().splitlines(), marks, strict=True)]
    return "\n".join([f"{HEAD},{title}", *lines]) + "\n"


#: A text that is no whole record, how it is asked for, some of the columns that it gives, and what is noticed.
GIVEN: dict[str, tuple[str, dict[str, Any], dict[str, Any], list[str]]] = {
    "a slower channel in the same rows": (
        SLOWER_TITLE + "\n".join(SLOWER), {}, RECORD | {"oil_temperature_c": 80 + np.minimum(np.arange(ROWS), 9)},
        ["brought_to_one_clock"],
    ),
    "dates beside each channel": (
        "Zeit_n;n [rpm];p [bar];Zeit_M;M [Nm]\n" + each(
            lambda t, p, n, m: f"2026-11-02 07:00:{t:06.3f};{n};{p};2026-11-02 07:00:{t + 0.02:06.3f};{m}"),
        {}, {"speed_rpm": RECORD["speed_rpm"][2:]}, ["brought_to_one_clock"],
    ),
    "a shorter channel with times beside it": (
        "Zeit_M [s];M [Nm];n [rpm];Zeit_p [s];p [bar]\n"
        + each(lambda t, _, n, m: f"{t};{m};{n};{HALF[round(100 * t)]}"),
        {}, {"pressure_bar": [*RECORD["pressure_bar"][:-1], 5.001]}, ["brought_to_one_clock"],
    ),
    "clocks put back between rows, each with its offset": (
        "time;M [Nm]\n2026-11-01T01:59:59-04:00;21\n2026-11-01T01:00:01-05:00;22\n", {}, {"time_s": [0.0, 2.0]}, [],
    ),
    "a time of two that is chosen": (TWO_CLOCKS, {"time": "Time [s]"}, RECORD, ["long_table"]),
    "a time that is not wanted": (
        "Zeit [s],p [bar],n [rpm],M [Nm]\n" + rows(), {"time": "none"}, {name: RECORD[name] for name in PLATEAUS}, [],
    ),
    "one option for every row without a value": (
        f"{HEAD}\n"
        + rows().replace("0.0300,5.0003", ",5.0003").replace("0.0500,5.0005", "0.0500,NaN").replace("20.0909", "---"),
        {"missing": "---"}, {"time_s": np.delete(TIME, [3, 5, 5])}, ["invalid_samples"],
    ),
    "a table on its side": (
        "\n".join(f"{name};{';'.join(map(str, column))}" for name, column in FIVE.items()), {}, FIVE, ["turned"],
    ),
    "a table on its side with units": (
        "\n".join(f"{title};{';'.join(map(str, column))}" for title, column in zip(
            ("Druck;bar", "Drehzahl;1/min", "Drehmoment;Nm"), FIVE.values(), strict=True)), {}, FIVE, ["turned"],
    ),
    "a title over merged cells": (  # only of the oil is a temperature known, and a pressure of the oil is suggested
        "Messwerte,,,Öl,\n" + ",".join(NAMES[name] for name in MERGED) + ",Temperatur [°C]\n"
        + "".join(f"{line},{60 + k}\n" for k, line in enumerate(rows(names=MERGED).splitlines())),
        {}, {name: values for name, values in RECORD.items() if name != "pressure_bar"}
        | {"oil_temperature_c": range(60, 60 + ROWS)}, ["columns_left_out"],
    ),
    "a unit in the map": (TWO_UNITS, {"mapping": "torque_nm:Mz [kNm]"}, {"torque_nm": [1000, 2000]}, ["columns_left_out"]),
    "a multiple in the map": (UNKNOWN_UNIT, {"mapping": "torque_nm:M [x10 Nm]"}, {"torque_nm": [10, 20]}, []),
    "the first of two tables": (TWO_TABLES, {"table": "1"}, {"torque_nm": [1]}, []),
    "the second of two tables": (TWO_TABLES, {"table": "2"}, {"torque_nm": [2]}, []),
    "thousands, by the option a decimal comma": (THOUSANDS, {"decimal": ","}, {"speed_rpm": [800, 1100]}, []),
    "thousands, by the option a decimal point": (THOUSANDS, {"decimal": "."}, {"speed_rpm": [800, 1.1]}, []),
    "fractions of a day": (DAYS, {"mapping": "time_s:Time [d]"}, {"time_s": 28512 + np.arange(ROWS)}, []),
    "fractions of the second beside it": (
        "Time;ms;p [bar];n [rpm];M [Nm]\n" + "".join(
            f"08:00:0{k // 4};{k % 4 * 250};{line}\n" for k, line in enumerate(rows(";", names=PLATEAUS).splitlines())),
        {}, {"time_s": 0.25 * np.arange(ROWS)}, ["parts_of_seconds"],
    ),
    **{f"rows that {title} marks invalid": (
        marked(title, good, bad), {}, {name: np.delete(column, 3) for name, column in RECORD.items()},
        ["columns_left_out", "invalid_samples"],
    ) for title, good, bad in (("M gültig", 1, 0), ("Quality", "Good", "Bad"), ("invalid", 0, 1))},
    **{f"{title} as {unit}": (
        f"t [s];{title}\n0;1\n1;2\n", {"mapping": f"torque_nm:{title} [{unit}]"}, {"torque_nm": [factor, 2 * factor]}, [],
    ) for title, unit, factor in UNCLEAR},
    **{f"{title} as {unit}": (
        SCALED.format(title), {"mapping": f"torque_nm:{title} [{unit}]"}, {"torque_nm": [20 * times, 19 * times]}, [],
    ) for title, factor in FACTORS for unit, times in ((f"x{factor:g} Nm", factor), ("Nm", 1.0))},
}  # fmt: skip


@pytest.mark.parametrize("name", GIVEN)
def test_a_text_gives_what_it_is_asked_for(tmp_path: Path, name: str) -> None:
    content, asked, expected, codes = GIVEN[name]
    read = read_content(tmp_path, content, **asked)
    assert [notice.code for notice in read.notices] == codes
    assert read.columns.keys() == expected.keys() or len(expected) == 1
    if codes == ["parts_of_seconds"]:
        assert "the fractions in ms were added" in read.notices[0].message
    for channel, values in expected.items():
        np.testing.assert_allclose(read.columns[channel], values, rtol=1e-9, atol=0, err_msg=channel)


# --- numbers that are no measurements ---


@pytest.mark.parametrize(
    ("channel", "mark"),
    [(channel, mark) for channel in ("pressure_bar", "speed_rpm", "torque_nm")
     for mark in ("-9999", "9999", "-999", "-999.25", "99999", "32767", "-32768", "1e30", "6.9e6", "-9999.000")]
    + [("time_s", "-9999"), ("time_s", "9999"), ("torque_nm", "999"), ("pressure_bar", "999")],
)  # fmt: skip
def test_a_number_that_may_stand_for_no_value_needs_an_option(tmp_path: Path, channel: str, mark: str) -> None:
    lines = [line.split(",") for line in rows().splitlines()]
    lines[-1][list(RECORD).index(channel)] = mark
    text = "\n".join([HEAD, *map(",".join, lines)]) + "\n"
    with pytest.raises(InvalidError, match=rf"{channel}\[11\] \(line 13\)") as caught:
        read_content(tmp_path, text)
    missing = re.search(r"add missing=(\S+); to use", caught.value.detail)
    read = read_content(tmp_path, text, missing=missing[1])
    assert {name: column.tolist() for name, column in read.columns.items()} == {
        name: values[:-1].tolist() for name, values in RECORD.items()
    }
    assert channel == "time_s" or [notice.code for notice in read.notices] == ["invalid_samples"]


MEASURED = {
    "speeds-in-steps-of-ten": [1, 10, 100, 999],
    "an-idle-valve": [0, 0.01, 0.02, 0.01, 5, 5, 5, 5],
    "set-points": [0, 0, 0, 20, 20, 20],
    "both-directions": [-999, -500, 500, 999],
    "a-spike": [20.1, 20.3, 20.2, 20.1, 350.5, 20.2],
}


@pytest.mark.parametrize("name", MEASURED)
def test_measured_numbers_are_read(tmp_path: Path, name: str) -> None:
    text = "\n".join(["torque_nm", *map(str, MEASURED[name])]) + "\n"
    assert read_content(tmp_path, text).columns["torque_nm"].tolist() == MEASURED[name]


def test_a_drop_to_a_number_of_nines_within_the_range_is_refused(tmp_path: Path) -> None:
    speeds = [f"{1500 + row % 3 if row != 30 else 999}" for row in range(60)]
    with pytest.raises(InvalidError, match=r"speed_rpm\[31\] .*is 999,.*missing=999"):
        read_content(tmp_path, "\n".join(["speed_rpm", "0", *speeds]) + "\n")


STATISTICS: dict[str, Callable[[np.ndarray], float]] = {
    "means": np.mean, "sums": np.sum, "maxima": np.max, "minima": np.min, "medians": np.median,
    "standard deviations": lambda column: np.std(column, ddof=1),
}  # fmt: skip


@pytest.mark.parametrize("names", [*([name] for name in STATISTICS), ["means", "maxima", "minima"]], ids="-".join)
@pytest.mark.parametrize("held", [FIVE, RECORD], ids=["plateaus", "record"])
def test_rows_of_statistics_are_left_out(tmp_path: Path, held: dict[str, np.ndarray], names: list[str]) -> None:
    lines = [",".join(map(str, row)) for row in zip(*held.values(), strict=True)]
    without_time = held is RECORD and not {"maxima", "minima"} & set(names)
    form = "{:.2f}" if without_time else "{:.10g}"
    made = [",".join(form.format(STATISTICS[name](np.array(column))) for column in held.values()) for name in names]
    if without_time:
        made = ["," + line.partition(",")[2] for line in made]
    read = read_content(tmp_path, "\n".join([",".join(held), *lines, "", *made]) + "\n")
    assert {name: column.tolist() for name, column in read.columns.items()} == {k: list(v) for k, v in held.items()}
    (notice,) = read.notices
    line = len(lines) + 3
    rows = "row" if len(names) == 1 else "rows"
    assert notice.message.startswith(f"left out: {len(names)} {rows} from line {line} on, the ")
    assert ", ".join(names) in notice.message or (held is RECORD and names == ["medians"])  # which are its means too


def test_a_long_table_on_its_side_is_refused_and_not_read_in_part(tmp_path: Path) -> None:
    titles = ["Druck;bar", "Drehzahl;1/min", "Drehmoment;Nm", "Öltemperatur;°C"]
    lines = [";".join([title, *["10.25"] * 9000]) for title in titles]
    with pytest.raises(TooLargeError, match="send it with a column a channel"):
        read_content(tmp_path, "\n".join(lines) + "\n")


MS = ["t.ms", "Time..ms.", "timeMs", "T_MS", "time-ms", "Uhr, ms", "ms", "Time ms:", "Time (in ms)", "Time - ms",
      "Zeit (Millisekunden)", "Uhr, мс", "Uhr, ミリ秒"]  # fmt: skip


@pytest.mark.parametrize("title", MS)
def test_a_mapped_title_that_ends_in_a_unit_is_that_unit(tmp_path: Path, title: str) -> None:
    lines = [f"{title};M [Nm]", *(f"{1000 * time};1" for time in TIME)]
    columns = read_content(tmp_path, "\n".join(lines) + "\n", f"time_s:{title}").columns
    np.testing.assert_allclose(columns["time_s"], TIME, rtol=0, atol=1e-12)


# --- workbooks, MATLAB, HDF5, Parquet, ZIP ---


def german_workbook(path: Path) -> None:
    book = openpyxl.Workbook()
    sheet = book.active
    sheet.title = "Messung"
    titles = ["Zeit", "Druck", "Drehzahl", "Drehmoment", "Bemerkung"]
    for row in (["Prüfstand 3"], ["Lastspiele", 7000], [], titles, ["s", "bar", "1/min", "Nm"]):
        sheet.append(row)
    for values in zip(*RECORD.values(), strict=True):
        sheet.append([*map(float, values), "ok"])
    sheet.merge_cells("A1:D1")
    book.create_sheet("Notizen").append(["nichts"])
    book.save(path)


def dated_workbook(path: Path) -> None:
    book = xlsxwriter.Workbook(path, {"default_date_format": "yyyy-mm-dd hh:mm:ss.000"})
    sheet = book.add_worksheet()
    for place, title in enumerate(["timestamp", "p [bar]", "n [rpm]", "M [Nm]"]):
        sheet.write(0, place, title)
    for row, values in enumerate(zip(*RECORD.values(), strict=True), 1):
        sheet.write_datetime(row, 0, datetime(2026, 11, 2, 7) + timedelta(seconds=float(values[0])))
        for place, value in enumerate(values[1:], 1):
            sheet.write(row, place, value)
    book.close()


def hdf5(path: Path, *, rate: bool) -> None:
    with h5py.File(path, "w") as file:
        group = file.create_group("rig")
        if rate:
            group.attrs["sample_rate"] = 100.0
        else:
            group.create_dataset("time", data=TIME * 1e3).attrs["unit"] = "ms"
        for name, unit in (("pressure", "bar"), ("speed", "rpm"), ("torque", "Nm")):
            group.create_dataset(name, data=RECORD[f"{name}_{unit.lower()}"]).attrs["unit"] = unit


def pandas_fixed(path: Path) -> None:
    with h5py.File(path, "w") as file:
        for name in ("axis0", "block0_items"):
            file[f"run/{name}"] = np.array(list(RECORD), dtype="S")
        file["run/axis1"], file["run/block0_values"] = np.arange(ROWS), np.c_[*RECORD.values()]


def version_73(path: Path) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in RECORD.items():
            file.create_dataset(name, data=values.reshape(1, -1)).attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file ")


def struct(path: Path) -> None:
    columns = zip(RECORD.items(), ("s", "bar", "1/min", "Nm"), strict=True)
    fields = {channel.rpartition("_")[0]: {"data": values, "unit": unit} for (channel, values), unit in columns}
    scipy.io.savemat(path, {"test": fields})


def zipped(path: Path) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("run/a.csv", frame().to_csv())
        archive.writestr("run/readme.txt", "a rig\nand no table\n")
        archive.writestr("run/plot.png", b"\x89PNG")


MADE: dict[str, Callable[[Path], object]] = {
    "german.xlsx": german_workbook,
    "dated.xlsx": dated_workbook,
    "pandas.xlsx": lambda path: frame().to_excel(path),
    "ms.h5": lambda path: hdf5(path, rate=False),
    "rate.h5": lambda path: hdf5(path, rate=True),
    "v73.mat": version_73,
    "vectors.mat": lambda path: scipy.io.savemat(path, RECORD),
    "packed.mat": lambda path: scipy.io.savemat(path, RECORD, do_compression=True),
    "v4.mat": lambda path: scipy.io.savemat(path, RECORD, format="4"),
    "struct.mat": struct,
    "matrix.mat": lambda path: scipy.io.savemat(
        path, {"data": np.c_[*RECORD.values()], "names": np.array(list(NAMES.values()), dtype=object)}
    ),
    "pandas.parquet": lambda path: frame().assign(note="x").to_parquet(path),
    "dates.parquet": lambda path: (
        frame().drop(columns="time_s").assign(time=pd.Timestamp("2026-11-02") + pd.to_timedelta(TIME, unit="s"))
    ).to_parquet(path),
    "long.parquet": lambda path: frame().melt("time_s").to_parquet(path),
    "long.xlsx": lambda path: frame().melt("time_s").to_excel(path),
    "pandas-fixed.h5": pandas_fixed,
    "narrow.parquet": lambda path: frame().assign(pressure_bar=lambda f: f.pressure_bar.astype("float64")).to_parquet(path),
    "folder.zip": zipped,
}  # fmt: skip


@pytest.mark.parametrize("name", MADE)
def test_a_file_of_a_library_gives_its_numbers(tmp_path: Path, name: str) -> None:
    MADE[name](tmp_path / name)
    assert_record(read_file(tmp_path / name, filename=name))


def test_a_preview_shows_the_table_and_what_is_understood(tmp_path: Path) -> None:
    german_workbook(tmp_path / "a.xlsx")
    shown = preview_file(tmp_path / "a.xlsx", filename="a.xlsx")
    assert (shown["table"], shown["tables"], shown["first_line"]) == ("Messung", ["Messung", "Notizen"], 6)
    assert [column["channel"] for column in shown["columns"]] == [*RECORD, None]
    assert read_file(tmp_path / "a.xlsx", filename="a.xlsx").labels["Lastspiele"] == "7000"


def test_files_of_libreoffice_in_three_languages_give_their_numbers() -> None:
    for path in sorted((Path(__file__).parent / "libreoffice").glob("*.[cox]*s*")):
        assert_record(read_file(path, filename=path.name))


# --- clocks, factors and marks that HDF5 and MATLAB files state ---


def rig(file: h5py.Group, *, without: tuple[str, ...] = ("time_s",)) -> None:
    for channel, unit in (("time_s", "s"), ("pressure_bar", "bar"), ("speed_rpm", "1/min"), ("torque_nm", "Nm")):
        if channel not in without:
            file.create_dataset(channel.rpartition("_")[0], data=RECORD[channel]).attrs["unit"] = unit


def read_hdf5(path: Path, fill: Callable[[h5py.File], object]) -> Channels:
    with h5py.File(path, "w") as file:
        fill(file)
    return to_channels(hdf5_reader.read_table(path, Reading(), LIMITS), Reading(), LIMITS)


@pytest.mark.parametrize(
    "stated",
    [{"dt": 10.0, "dt_unit": "ms"}, {"dt_ms": 10.0}, {"sample_rate_khz": 0.1}, {"sample_rate": "100 Hz"}, {"fs": "0.1 kHz"},
     {"Sample Rate (Hz)": 100.0}, {"sampling_interval": 0.01}],
    ids=str,
)  # fmt: skip
def test_a_clock_in_any_unit_is_used(tmp_path: Path, stated: dict[str, object]) -> None:
    columns = read_hdf5(tmp_path / "a.h5", lambda file: (rig(file), file.attrs.update(stated))).columns
    np.testing.assert_allclose(columns["time_s"], TIME, rtol=0, atol=1e-12)


def test_a_clock_above_the_group_or_in_a_folder_of_its_own_is_used(tmp_path: Path) -> None:
    def of_the_file(file: h5py.File) -> None:
        file.attrs["sample_rate"] = 100.0
        rig(file.create_group("rig"))

    def beside(file: h5py.File) -> None:
        for channel, unit in (("pressure_bar", "bar"), ("speed_rpm", "1/min"), ("torque_nm", "Nm")):
            group = file.create_group(channel)
            group.create_group("x_values").attrs.update({"start_value": 0.0, "increment": 0.01})
            group.create_dataset(channel, data=RECORD[channel]).attrs["unit"] = unit

    for fill in (of_the_file, beside):
        np.testing.assert_allclose(read_hdf5(tmp_path / "a.h5", fill).columns["time_s"], TIME, rtol=0, atol=1e-12)


def test_a_clock_in_an_unknown_unit_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidError, match="the unit of dt must be one of s, ms, min, got 'ticks'"):
        read_hdf5(tmp_path / "a.h5", lambda file: (rig(file), file.attrs.update({"dt": 10.0, "dt_unit": "ticks"})))


def counts(**attributes: float) -> Callable[[h5py.File], object]:
    def fill(file: h5py.File) -> None:
        rig(file, without=("torque_nm",))
        counted = file.create_dataset("torque", data=np.round(RECORD["torque_nm"] * 1e4).astype(np.int32))
        counted.attrs.update({"unit": "Nm", **attributes})

    return fill


def test_packed_data_is_unpacked_and_raw_counts_are_refused(tmp_path: Path) -> None:
    columns = read_hdf5(tmp_path / "a.h5", counts(scale_factor=1e-4, add_offset=0.0)).columns
    np.testing.assert_allclose(columns["torque_nm"], RECORD["torque_nm"], rtol=1e-12)
    with pytest.raises(InvalidError, match=r"torque holds whole numbers beside gain = 0\.0001"):
        read_hdf5(tmp_path / "b.h5", counts(gain=1e-4))


def test_values_that_stand_for_none_are_left_out_with_a_warning(tmp_path: Path) -> None:
    fill = counts(scale_factor=1e-4, _FillValue=round(RECORD["torque_nm"][3] * 1e4))
    channels = read_hdf5(tmp_path / "a.h5", fill)
    np.testing.assert_allclose(channels.columns["time_s"], np.delete(TIME, 3), rtol=1e-12)
    assert [notice.code for notice in channels.notices] == ["invalid_samples"]


# --- bombs ---


def with_entities(text: str) -> bytes:
    """The XML with entities that unfold to 3 GB, and a use of them."""
    entities = "".join(f'<!ENTITY e{level} "{f"&e{level - 1};" * 10}">' for level in range(1, 10))
    body = text.partition("?>")[2] if text.startswith("<?xml") else text
    return f'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY e0 "lol">{entities}]>{body}'.encode()


def repacked(path: Path, source: Path, member: str, change: Callable[[str], bytes]) -> Path:
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            content = old.read(name)
            new.writestr(name, change(content.decode()) if name == member else content)
    return path


ODS = Path(__file__).parent / "libreoffice" / "german.ods"
BOMBS: dict[str, tuple[str, Callable[[str], bytes]]] = {
    "entities.xlsx": (
        "xl/worksheets/sheet1.xml",
        lambda xml: with_entities(xml.replace("</row>", '<c t="inlineStr"><is><t>&e9;</t></is></c></row>', 1)),
    ),
    "a-far-cell.xlsx": ("xl/worksheets/sheet1.xml", lambda xml: xml.replace('r="B2"', 'r="XFD1048576"').encode()),
    "entities.ods": ("content.xml", lambda xml: with_entities(xml.replace("Druck", "&e9;"))),
    "repeated-rows.ods": (
        "content.xml",
        lambda xml: xml.replace(
            "<table:table-row", '<table:table-row table:number-rows-repeated="1000000"', 1
        ).encode(),
    ),
}


@pytest.mark.parametrize("name", BOMBS)
def test_bombs_in_xml_are_refused(tmp_path: Path, name: str) -> None:
    member, change = BOMBS[name]
    plain = tmp_path / "plain.xlsx"
    frame().to_excel(plain, index=False)
    path = repacked(tmp_path / name, ODS if name.endswith("ods") else plain, member, change)
    with pytest.raises((InvalidError, TooLargeError)):
        read_file(path, filename=name)


def test_an_archive_with_a_file_without_a_name_is_read(tmp_path: Path) -> None:
    zipped(tmp_path / "a.zip")
    content = bytearray((tmp_path / "a.zip").read_bytes())
    content[content.rindex(b"run/plot.png")] = 0
    assert_record(read_content(tmp_path, bytes(content), name="a.zip"))


@pytest.mark.parametrize("inner", ["xl/worksheets/sheet1.xml", "run.csv"])
def test_bombs_are_refused_by_what_they_state(tmp_path: Path, inner: str) -> None:
    with zipfile.ZipFile(tmp_path / "a.xlsx", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("[Content_Types].xml" if "xml" in inner else "b.csv", "<x/>")
        archive.writestr(inner, b" " * (64 << 20))
    with pytest.raises(TooLargeError, match="must not unpack to more than"):
        read_file(tmp_path / "a.xlsx", filename="a.xlsx")


# --- no factor ---

GERMAN_NAMES = ("Zeit", "Druck", "Drehzahl", "Drehmoment", "Öltemperatur")
TITLES = dict(zip((*RECORD, "oil_temperature_c"), GERMAN_NAMES, strict=True))
UNIT = {channel: sorted(UNITS[CHANNELS[channel].unit]) for channel in TITLES}


@settings(max_examples=100, deadline=None)
@given(
    st.fixed_dictionaries({channel: st.sampled_from(units) for channel, units in UNIT.items()}),
    st.sampled_from(["{} [{}]", "{} ({})", "{}（{}）", "{} / {}", "{} in {}", "{}, {}", "{}_{}"]),
    st.sampled_from([";. ", ";, ", ";,.", "\t.,", "\t,.", "|.,"]),
    st.sampled_from(["%.0f", "%.1f", "%.3f", "%.6f", "%r"]),
    st.booleans(),
    st.lists(st.tuples(*[st.floats(0.001, 9000)] * len(TITLES)), min_size=2, max_size=5),
)
def test_no_file_is_accepted_with_a_channel_off_by_a_factor(
    tmp_path_factory: pytest.TempPathFactory,
    units: dict[str, str],
    title: str,
    signs: str,
    number: str,
    mapped: bool,
    values: list[tuple[float, ...]],
) -> None:
    """Whatever units, separators, decimals and thousands a file has: it gives the numbers that it states, or is refused."""
    separator, decimal, thousands = signs[0], signs[1], signs[2].strip()
    titles = [title.format("Kanal " + name if mapped else name, units[channel]) for channel, name in TITLES.items()]
    printed = [[number % value for value in row] for row in values]
    lines = [separator.join([_grouped(cell, decimal, thousands) for cell in row]) for row in printed]
    mapping = ",".join(f"{channel}:{title}" for channel, title in zip(TITLES, titles, strict=True)) if mapped else None
    text = "\n".join([separator.join(titles), *lines]) + "\n"
    try:
        found = read_content(tmp_path_factory.getbasetemp(), text, mapping)
    except InvalidError:
        return
    columns = found.columns
    for place, channel in enumerate(TITLES):
        if channel not in columns:  # a clock that stands still and whose unit is a letter
            assert any(titles[place] in notice.message for notice in found.notices), channel
            continue
        stated = UNITS[CHANNELS[channel].unit][units[channel]]
        expected = [stated.factor * float(row[place]) + stated.offset for row in printed]
        np.testing.assert_allclose(columns[channel], expected, rtol=1e-9, atol=1e-9, err_msg=channel)


@settings(max_examples=60, deadline=None)
@given(
    st.fixed_dictionaries({channel: st.sampled_from(units) for channel, units in UNIT.items()}),
    st.sampled_from(["dt", "sampling_interval", "Delta_X"]),
    st.sampled_from(["attribute beside", "end of the name", "in the text"]),
    st.booleans(),
    st.lists(st.tuples(*[st.floats(0.001, 9000)] * 3), min_size=2, max_size=5),
)
def test_no_array_is_accepted_with_a_factor_or_a_clock_that_is_off(
    tmp_path_factory: pytest.TempPathFactory,
    units: dict[str, str],
    name: str,
    way: str,
    packed: bool,
    values: list[tuple[float, ...]],
) -> None:
    def fill(file: h5py.File) -> None:
        unit = units["time_s"]
        if way == "attribute beside":
            file.attrs.update({name: 20.0, f"{name}_unit": unit})
        else:
            file.attrs.update({f"{name}_{unit}": 20.0} if way == "end of the name" else {name: f"20 {unit}"})
        for place, channel in enumerate(PLATEAUS):
            title = channel.rpartition("_")[0]
            data = np.array([row[place] for row in values])
            held = file.create_dataset(title, data=data * 2 if packed else data)
            held.attrs.update({"unit": units[channel]} | ({"scale_factor": 0.5} if packed else {}))

    try:
        columns = read_hdf5(tmp_path_factory.getbasetemp() / "factor.h5", fill).columns
    except InvalidError:
        return
    step = 20 * UNITS["s"][units["time_s"]].factor
    np.testing.assert_allclose(columns["time_s"], step * np.arange(len(values)), rtol=1e-9)
    for place, channel in enumerate(PLATEAUS):
        expected = [UNITS[CHANNELS[channel].unit][units[channel]].factor * row[place] for row in values]
        np.testing.assert_allclose(columns[channel], expected, rtol=1e-9, err_msg=channel)


def test_a_header_beside_its_data_is_used(tmp_path: Path) -> None:
    """As catman writes MATLAB files; the units are not the channels' own."""
    units = {"time_s": ("ms", 1e3), "pressure_bar": ("kPa", 100), "speed_rpm": ("rpm", 1), "torque_nm": ("Nm", 1)}
    held: dict[str, object] = {}
    for number, (channel, (unit, factor)) in enumerate(units.items(), 1):
        held[f"Channel_{number}_Data"] = RECORD[channel] * factor
        held[f"Channel_{number}_Header"] = {"SignalName": channel.rpartition("_")[0], "Unit": unit}
    scipy.io.savemat(tmp_path / "a.mat", held)
    assert_record(read_file(tmp_path / "a.mat", filename="a.mat"))


@pytest.mark.parametrize("way", ["text of JSON", "list", "attribute of each"])
def test_units_beside_a_compound_or_a_group_are_used(tmp_path: Path, way: str) -> None:
    names, units = ["time", "pressure", "speed", "torque"], ["ms", "MPa", "rpm", "Nm"]
    columns = [RECORD["time_s"] * 1e3, RECORD["pressure_bar"] / 10, RECORD["speed_rpm"], RECORD["torque_nm"]]

    def fill(file: h5py.File) -> None:
        if way == "text of JSON":
            file.attrs["units"] = json.dumps(dict(zip(names, units, strict=True)))
            for name, column in zip(names, columns, strict=True):
                file.create_dataset(name, data=column)
            return
        rows = np.array(list(zip(*columns, strict=True)), dtype=[(name, "f8") for name in names])
        held = file.create_dataset("log", data=rows)
        each = {f"{name}_unit": unit for name, unit in zip(names, units, strict=True)}
        held.attrs.update({"units": units} if way == "list" else each)

    assert_record(read_hdf5(tmp_path / "a.h5", fill))


@pytest.mark.parametrize("name", ["Scale", "CalibrationFactor", "lsb_weight", "resolution"])
def test_whole_numbers_beside_any_factor_are_refused(tmp_path: Path, name: str) -> None:
    counts = np.round(RECORD["torque_nm"] * 100).astype(np.int16)
    with TdmsWriter(tmp_path / "a.tdms") as writer:
        writer.write_segment([ChannelObject("g", "Torque", counts, properties={"unit_string": "Nm", name: 0.01})])
    field = pa.field("torque", pa.int16(), metadata={"unit": "Nm", name: "0.01"})
    parquet.write_table(pa.table([counts], schema=pa.schema([field])), tmp_path / "a.parquet")
    for file in ("a.tdms", "a.parquet"):
        with pytest.raises(InvalidError, match=f"beside {name} = 0.01"):
            read_file(tmp_path / file, filename=file)


@pytest.mark.parametrize(
    ("kind", "words"),
    [("Polynomial", None), ("Exponential", "has the scale 'Exponential', which the service cannot apply")],
)
def test_a_scale_of_tdms_is_applied_or_refused(tmp_path: Path, kind: str, words: str | None) -> None:
    """Five coefficients without their number: npTDMS would take four, and raw counts for a kind that it does not know."""
    stated = {f"NI_Scale[0]_Polynomial_Coefficients[{power}]": c for power, c in enumerate([1.0, 0.5, 0.0, 0.0, 0.25])}
    stated |= {"NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": kind, "unit_string": "Nm"}
    with TdmsWriter(tmp_path / "a.tdms") as writer:
        writer.write_segment([ChannelObject("g", "Torque", np.array([1.0, 2.0, 3.0]), properties=stated)])
    if words:
        with pytest.raises(InvalidError, match=words):
            read_file(tmp_path / "a.tdms", filename="a.tdms")
    else:
        torque = read_file(tmp_path / "a.tdms", filename="a.tdms").columns["torque_nm"]
        np.testing.assert_allclose(torque, [1.75, 6.0, 22.75])


def test_a_clock_above_the_table_of_a_sheet_is_used_and_a_hidden_sheet_is_not(tmp_path: Path) -> None:
    book = openpyxl.Workbook()
    hidden = book.create_sheet("raw")
    hidden.sheet_state = "hidden"
    for one in book:
        one.append(["Sampling cycle", "10ms"])
        one.append(["Druck [bar]", "Drehzahl [1/min]", "M [Nm]"])
        for row in zip(*(RECORD[name].tolist() for name in PLATEAUS), strict=True):
            one.append(row)
    book.save(tmp_path / "a.xlsx")
    assert_record(read_file(tmp_path / "a.xlsx", filename="a.xlsx"))


def _grouped(cell: str, decimal: str, thousands: str) -> str:
    whole, point, fraction = cell.partition(".")
    if thousands and "e" not in cell:
        whole = f"{int(whole):,}".replace(",", thousands)
    return whole + (decimal + fraction if point else "")
