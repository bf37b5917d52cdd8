"""Files that were broken off: rows that are short, texts without an end, zeros after a power loss, binaries of others."""

from pathlib import Path

import pytest

from service.errors import InvalidError
from service.readers.assemble import Channels
from tests.service.readers.sample_files import read_content

TITLES = "p [bar],n [1/min],M [Nm],T_set [degC],valve"
LINES = [
    f"4.00,{speed}.0,{torque},40.0,1" for speed, torque in zip(range(20, 120, 10), range(17_442, 17_452), strict=True)
]
LINES = [line.replace(",17", ",17.", 1) for line in LINES]
WHOLE = "\n".join([TITLES, *LINES]) + "\n"
TORQUES = [17.442, 17.443, 17.444, 17.445, 17.446, 17.447, 17.448, 17.449, 17.45, 17.451]


def torques(read: Channels) -> list[float]:
    return [round(value, 6) for value in read.columns["torque_nm"].tolist()]


@pytest.mark.parametrize("cut", ["4.00,60.0,1", "4.00,60.0,17.446", "4.00,17.446,40.0,1", "4.00,60.0,17.446,40.0"])
def test_a_short_row_in_the_body_is_refused_with_its_line(tmp_path: Path, cut: str) -> None:
    with pytest.raises(InvalidError, match="line 6 must have 5 cells, got"):
        read_content(tmp_path, WHOLE.replace(LINES[4], cut))


def test_rows_that_all_end_before_the_last_title_are_whole(tmp_path: Path) -> None:
    """LabVIEW has a title for comments, and no cell where there is none."""
    rows = [line.rpartition(",")[0] for line in LINES]
    text = "\n".join([TITLES, *rows[:5], f"{rows[5]},open", *rows[6:]]) + "\n"
    assert torques(read_content(tmp_path, text)) == TORQUES


@pytest.mark.parametrize("end", range(1, len(LINES[-1]) + 1))
def test_a_last_line_without_its_end_is_left_out_and_said_so(tmp_path: Path, end: int) -> None:
    """Wherever it was cut; what is after the torque matters to nobody."""
    read = read_content(tmp_path, WHOLE[: -len(LINES[-1]) - 1] + LINES[-1][:end])
    (cut,) = [notice.message for notice in read.notices if notice.code == "lines_left_out"] or [""]
    assert torques(read) == (TORQUES if not cut else TORQUES[:-1])
    assert not cut or "the last line (11), which has no line feed at its end" in cut
    assert bool(cut) == (end < len(LINES[-1]) - 1)


@pytest.mark.parametrize(("last", "kept"), [("24.352", True), ("24.35", False), ("2", False), ('"24.352"', True)])
def test_a_last_number_is_whole_if_it_has_as_many_decimals_as_the_others(tmp_path: Path, last: str, kept: bool) -> None:
    text = f"p [bar],n [1/min],M [Nm]\n4.00,20.0,17.442\n4.00,70.0,17.091\n6.00,1970.0,{last}"
    assert torques(read_content(tmp_path, text)) == [17.442, 17.091, *([24.352] if kept else [])]


def test_numbers_without_decimals_may_be_cut_anywhere(tmp_path: Path) -> None:
    read = read_content(tmp_path, "p [bar],n [1/min],M [Nm]\n4,20,17\n4,70,17\n6,1970,24")
    assert torques(read) == [17, 17]


def test_words_below_a_table_need_no_end(tmp_path: Path) -> None:
    assert torques(read_content(tmp_path, WHOLE + "Ende der Messung")) == TORQUES


@pytest.mark.parametrize("ending", ["", "4.00,120.0,1"])
@pytest.mark.parametrize("count", [500, 300_000])
def test_zeros_at_the_end_are_left_out_and_said_so(tmp_path: Path, ending: str, count: int) -> None:
    read = read_content(tmp_path, WHOLE.encode() + ending.encode() + bytes(count))
    assert torques(read) == TORQUES
    said = [notice.message for notice in read.notices]
    assert f"left out: {count} zero bytes after line 11, as a logger leaves where power was lost" in said
    assert any("the last line (12)" in message for message in said) == bool(ending)


@pytest.mark.parametrize("count", [1, 500, 300_000])
def test_zeros_amid_the_rows_are_refused_with_what_is_before_them(tmp_path: Path, count: int) -> None:
    with pytest.raises(InvalidError, match=r"line 12 has zero bytes .* the 11 lines before it are text"):
        read_content(tmp_path, WHOLE.encode() + bytes(count) + WHOLE.encode())


@pytest.mark.parametrize(
    ("name", "head", "words"),
    [
        ("a.d7d", b"MULTI_STREAM_FILE_VER0200", "a Dewesoft file"),
        ("a.rsp", b"FORMAT\0\0", "an MTS RPC file"),
        ("a.bin", b"\x94\x13\0\x80", "an HBM catman file (catman exports CSV"),
        ("a.nc", b"CDF\x01", "a NetCDF 3 file"),
        ("a.xrk", b"<hCNF\0\x10", "an AiM file (RaceStudio exports CSV files)"),
        ("a.ld", b"\x40\0\0\0", "in MoTeC i2, export the channels as one of these"),
        ("a.xyz", b"Some maker's own\r\n\0\x01", "in the program that wrote it, export the channels"),
    ],
)
def test_a_binary_of_others_is_named_with_the_way_out(tmp_path: Path, name: str, head: bytes, words: str) -> None:
    with pytest.raises(InvalidError) as caught:
        read_content(tmp_path, head + bytes(range(256)) * 8, name=name)
    assert words in caught.value.detail
    assert "UTF-8" not in caught.value.detail


def test_binary_data_after_text_is_named_so(tmp_path: Path) -> None:
    with pytest.raises(InvalidError, match="line 13 begins binary data"):
        read_content(tmp_path, WHOLE.encode() + b"#" * 5000 + b"\n" + bytes([0, 1, 2, 3]) * 50)
