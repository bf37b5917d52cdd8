"""The table in a grid of cells: which rows are titles, units and data, whatever stands above them.

Cells are text (CSV) or what a workbook holds. The data are the longest run of rows with numbers or times in the same
columns, under the row of titles that knows most channels; a row of units, titles over two rows (merged cells), and a group's
name over several columns may stand there too.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, zip_longest
from typing import Any

from service.errors import MAX_QUOTED, InvalidError, Notice
from service.readers.column_names import bare_unit, column_of, is_counter, recognised, with_unit
from service.readers.limits import LONGEST_TITLE, LONGEST_UNIT
from service.readers.meanings import known_channel, meaning
from service.readers.numerals import NUMBER, Stamps, is_ditto, is_stamp, with_unit_apart
from service.readers.stated_clocks import stated_clock
from service.readers.table import FileColumn, Table, labels
from service.readers.unit_table import conversion, is_unit

Row = Sequence[Any]

#: The notice of a table that lies on its side.
TURNED = Notice(code="turned", message="the table has a line for each channel: its columns were read as rows")

#: Rows that are looked at for the table's beginning. Chosen: no recorder writes as many lines above it.
MAX_ROWS = 500
#: Rows of data that a person is shown.
_MAX_SHOWN = 20
#: Rows of a run by which two candidates are compared; longer ones count the same. Chosen: more than header blocks have.
_LONG_RUN = 8
#: Rows of text above the data among which titles and units are, at most; others between them do not count. Chosen: recorders
#: write six (channel, title, unit, filter, place, sensor).
_MAX_TITLE_ROWS = 12
#: What a row begins with that names the units of the columns beside it.
_UNIT_LABELS = re.compile(
    r"[a-z]{0,2}_?unit[éàs]*(_label)?s?:?|einheit(en)?:?|unidad(es)?:?|单位|單位|単位", re.IGNORECASE
)
#: What a row of a table says that is made of the rows about it.
_SUMMARY = re.compile(
    r"(?:\d+[ _.:-]+)?[øØ∅⌀]?(?:mean|average|avg|mittel(?:werte?)?|moy(?:enne)?|media|promedio|medel(?:värde)?|"
    r"max(?:im(?:um|a))?|min(?:im(?:um|a))?|sum(?:me)?|total|median|range|std(?:ev)?|stabw|standardabweichung|平均[値值]?|最[大小][値值]?|合[計计])\.?:?",
    re.IGNORECASE,
)
#: What stands between the two quantities of a table's corner (`n [1/min] \ p [bar]`).
CORNER = re.compile(r"\s*[\\|↓→]\s*|\s+/\s+")
_BRACKETS = re.compile(r"[\[(]")
#: The same below such a row.
_BELOW_SUMMARY = re.compile(
    r"[#]? ?(?:n|no|cnt|count|number|anzahl|points|s|sd|sigma|σ|cv|rms|var|varian[cz]e?|q\d*|p\d+|\d\d? ?%).{0,12}",
    re.IGNORECASE,
)
#: What a row begins with that holds a factor for each column.
_FACTORS = re.compile(r"\w*[ _]?(?:fa[ck]tor|gain|s[ck]al|slope|mult(?!i\b|i_))", re.IGNORECASE)
NUMERIC = re.compile(
    r"[+−-]? *(\d[\d.,'’\u00a0\u202f\u2009]*+|[.,]\d++)( ?[dDeE][+-]?\d{1,4})?|[+−-]?(nan|inf|infinity)",
    re.IGNORECASE | re.ASCII,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """The place of a table: each column's title, unit, group and first cell; the row of titles, the first row of data,
    the number of labelled rows with numbers between them, and a score for comparison with other rows of titles."""

    headings: tuple[tuple[str, str, str, Any], ...]
    titles: int
    start: int
    labelled: int
    score: tuple[int, int, int, int]

    def texts(self) -> tuple[tuple[str, str, str], ...]:
        """The titles, units and groups."""
        return tuple((title, unit, group) for title, unit, group, _ in self.headings)

    def fit(self) -> tuple[int, ...]:
        """The quality of a reading by a separator or an encoding: known titles, less the difference between the numbers
        of titles and cells."""
        return self.score[0] + self.score[1], *self.score

    def columns(self) -> tuple[FileColumn, ...]:
        """The columns; one of values without a title has its number for a name. Raises InvalidError on a title
        that is too long, or beside whose unit another is stated."""
        columns = []
        for number, (title, unit, group, cell) in enumerate(self.headings, 1):
            moment, cell_unit = _is_moment(cell), with_unit_apart(cell)[1]
            if moment or _is_word(title, cell):
                columns.append(column_of(title, group=group, moments=True))
            else:
                columns.append(with_unit(column_of(title, unit, group), cell_unit))
            if not title and is_value(cell):
                columns[-1] = replace(columns[-1], name=f"column {number}")
        return tuple(columns)


class DataRows:
    """The data rows under a table's titles: neither blank rows, nor repeated rows from above, nor footers.

    Repeated titles, and lines of words with a number in them (`4 bar`), begin a new block of the table.
    """

    def __init__(self, rows: Sequence[Row], layout: Layout) -> None:
        self.rows, self.layout, above = rows, layout, rows[: layout.start]
        self.titles, self.first_row = rows[layout.titles], rows[layout.start] if layout.start < len(rows) else []
        self._over = [shown(row) for row in above[-MAX_ROWS:]]
        self._labelled = above[-layout.labelled :] if layout.labelled else []
        self._above = {tuple(row) for row in above if not all(map(is_value, row))}
        self._summarised = _is_summary(self.first_row)
        #: The first row of data of each further block; the lines over each block; what is to be said.
        self.breaks: list[int] = []
        self.heads: list[Sequence[Sequence[str]]] = []
        self.notices: list[Notice] = []
        self.begin()

    def begin(self) -> None:
        """Begin again with the first row: the rows may be read several times."""
        self.breaks.clear()
        self.heads[:] = [self._over]
        self.notices.clear()
        self._summaries: list[Row] = []
        self._after_summary = False
        #: Lines of words that may be a footer or begin a block, comments beside them, and whether the titles stood again.
        self._words: list[tuple[int, Row]] = []
        self._comments: list[Row] = []
        self._titles_again = False
        if self._labelled:
            self._leave_out(self._labelled, "above the first row of")

    def of(self, rows: Iterable[tuple[int, Row, bool]], before: int, *, last: bool) -> tuple[list[int], list[Any]]:
        """Numbers and cells of those of the next rows that are data; `before` were found already, `last`: none follow.
        With each stands whether it is a comment, which is no data, but may say what a block is.

        Raises InvalidError on a row of other titles or other units.
        """
        data_rows: list[tuple[int, Row]] = []
        for number, row, comment in rows:
            if row == self.titles:
                self._titles_again = True
            elif comment:
                self._comments.append(row)
            elif is_blank(row) or tuple(row) in self._above:
                continue
            elif self._is_summary(row):
                self._summaries.append(row)
            elif is_footer(row, self.first_row) or self._is_label(row):
                self._refuse_other_titles(number, row)
                self._words.append((number, row))
            else:
                self._begin_block(data_rows, before)
                data_rows.append((number, row))
        if last and self._words:
            self._leave_out([row for _, row in self._words], "below")
        return [number for number, _ in data_rows], [row for _, row in data_rows]

    def _begin_block(self, data_rows: list[tuple[int, Row]], before: int) -> None:
        """Before a row of data: treat the lines since the last data row as the head of a new block, or as data."""
        if self._titles_again or any(any(map(str.isdigit, "".join(shown(row)))) for _, row in self._words):
            if before + len(data_rows):
                self.breaks.append(before + len(data_rows))
                self.heads.append([shown(row) for row in (*self._comments, *(row for _, row in self._words))])
        else:
            data_rows += self._words  # what is wrong with them is said where they are read
        self._words, self._comments, self._titles_again, self._after_summary = [], [], False, False

    def _is_summary(self, row: Row) -> bool:
        """Whether a row holds a statistic of the rows above: it has a word for one, or begins with a word in place of a
        number and goes on with numbers."""
        place = next((place for place, cell in enumerate(row) if cell not in (None, "")), 0)
        has_values = sum(map(is_value, row))
        first = sum(map(is_value, self.first_row))
        labelled = (
            place < len(self.first_row)
            and not (is_value(row[place]) or is_ditto(row[place]))
            and is_value(self.first_row[place])
            and has_values >= max(2, first - 1)
        )
        said = not self._summarised and (_is_summary(row) or (self._after_summary and _is_summary(row, _BELOW_SUMMARY)))
        self._after_summary = bool(has_values and (labelled or said))
        return self._after_summary

    def _is_label(self, row: Row) -> bool:
        """Whether a row is one value with its unit (`4 bar`) in a table with several cells per row."""
        filled = [cell for cell in row if cell not in (None, "")]
        return len(filled) == 1 < len(self.first_row) and bool(with_unit_apart(filled[0])[1])

    def _refuse_other_titles(self, number: int, row: Row) -> None:
        """Raise InvalidError on titles or units different from the table's."""
        if _are_units(row) or (not any(map(is_value, row)) and recognised(list(map(_text, row)), ()) > 1):
            got = " ".join(shown(row)).strip()[:MAX_QUOTED]
            message = (
                f"line {number} has other titles or units than the table above it, got {got!r}: send each table in a "
                "separate file"
            )
            raise InvalidError.of(message, code="mixed_units", value=got)

    def end(self) -> None:
        """Add the notice on rows left out, once all rows are read."""
        if self._summaries:
            self._leave_out(self._summaries, "of means, extremes or sums in")

    def _leave_out(self, rows: Sequence[Row], where: str) -> None:
        first = " ".join(shown(rows[0])).strip()[:MAX_QUOTED]
        lines = "1 line" if len(rows) == 1 else f"{len(rows)} lines"
        message = f"left out: {lines} {where} the table, beginning with {first!r}"
        self.notices.append(Notice(code="lines_left_out", message=message))


def _is_summary(row: Row, words: re.Pattern[str] = _SUMMARY) -> bool:
    return any(isinstance(cell, str) and words.fullmatch(cell) is not None for cell in row)


def table_in(data: DataRows, *, first_line: int, rows_read: Callable[[], int], **others: Any) -> Table:
    """The table of a grid, each column with the clock stated in the rows above it.

    LabVIEW's column of times may be empty: then it is none. Raises InvalidError where a row above holds factors.
    """
    rows, layout = data.rows, data.layout
    above = [shown(row) for row in rows[max(layout.start - MAX_ROWS, 0) : layout.start]]
    refuse_factors(above)
    head = [shown(row) for row in rows[layout.start : layout.start + _MAX_SHOWN]]
    columns = list(layout.columns())
    counted, stamps = _counted(columns, head), Stamps({}, set())
    for place, column in enumerate(columns):
        if is_counter(column) and shown(data.first_row)[place : place + 1] == ("",):
            columns[place] = FileColumn("", title=column.title)
            continue
        own_rows = [row for row in above if len(row) > place and row[place]]
        labelled = [(row[0], row[place]) if place and row in own_rows else row for row in above]
        clock = stated_clock(labels([*labelled, *((row[place],) for row in own_rows)]), rows_read, stamps, counted)
        columns[place] = replace(column, clock=clock)
    return Table(
        columns=tuple(columns),
        above=tuple(above[: layout.titles - layout.start]),
        first_line=first_line,
        head=tuple(head),
        breaks=data.breaks,
        heads=data.heads,
        notices=data.notices,
        **others,
    )


def _counted(columns: Sequence[FileColumn], head: Sequence[Sequence[str]]) -> str:
    """The column of integers, no channel, that counts samples in steps of several; "" if there is none."""
    for place, column in enumerate(columns):
        cells = [row[place] for row in head if len(row) > place]
        named = column.unit or known_channel(column.name) or is_unit(column.name)  # the milliseconds of a second
        if named or len(cells) < _LONG_RUN or not all(map(str.isdecimal, cells)):
            continue
        steps = {int(b) - int(a) for a, b in pairwise(cell[:15] for cell in cells)}
        if len(steps) == 1 and max(steps) > 1:
            return f"{column.shown()} rises by {max(steps)} a row"
    return ""


def shown(row: Row) -> tuple[str, ...]:
    """The cells of a row as text, whole numbers without a decimal point."""
    return tuple(str(int(cell)) if isinstance(cell, float) and cell.is_integer() else _text(cell) for cell in row)


def find_table(rows: Sequence[Row], comments: frozenset[int], named: Sequence[str]) -> Layout | None:
    """The table in the first rows of a grid; None if no row of titles stands over numbers.

    `comments` are rows that may hold titles but no data; `named` are titles named by the caller.
    """
    rows = _with_definitions(rows)
    runs = list(_runs(rows, comments)) or [(len(rows), 0)]
    rows = [*rows, ()]
    candidates = []
    for start, length in runs:
        layout = _layout(rows, comments, start, length, named)
        # titles without data are a table too, where they are known and nothing but units is under them
        if layout and not layout.score[3]:
            bare = all(is_blank(row) or _are_units(row) for row in rows[layout.titles + 1 :])
            layout = layout if layout.score[0] and bare else None
        candidates += [layout] if layout else []
    best = max(candidates, key=lambda layout: layout.score, default=None)
    # titles that are repeated within the data do not begin another table, nor do numbers with a label above them
    for layout in candidates:
        if best and layout.texts() == best.texts() and not is_footer(rows[layout.start], rows[best.start]):
            return layout
    return None


def _with_definitions(rows: Sequence[Row]) -> Sequence[Row]:
    """The rows with titles and units of a channel list above them (`CH1;Torque;...;Nm`) in place of their numbers."""
    defined: dict[str, str] = {}
    for row in rows:
        channel, *cells = map(_text, row if len(row) > 2 and not is_value(row[0]) else [""])
        if sum(cell in defined for cell in cells) > 1:
            continue  # the titles themselves, which name the channels
        unit = next((cell for cell in reversed(cells) if is_unit(cell)), "")
        name = next((cell for cell in cells if cell and known_channel(cell[:LONGEST_TITLE]) and not is_unit(cell)), "")
        if channel and name and unit and not known_channel(channel[:LONGEST_TITLE]):
            defined[channel] = f"{name} [{unit}]"
    if len(defined) < 2:
        return rows
    named = [sum(_text(cell) in defined for cell in row) for row in rows]
    return [
        [defined.get(_text(cell), cell) for cell in row] if count > 1 else row
        for row, count in zip(rows, named, strict=True)
    ]


def _runs(rows: Sequence[Row], comments: frozenset[int]) -> Iterator[tuple[int, int]]:
    """The runs of rows with a number or a time in them: first row and number of rows."""
    start, length = 0, 0
    for index, row in enumerate(rows):
        if index in comments or is_blank(row):
            continue
        if _has_values(row):
            start, length = (start, length + 1) if length else (index, 1)
        elif length:
            yield start, length
            length = 0
    if length:
        yield start, length


def _skip_labelled_rows(rows: Sequence[Row], comments: frozenset[int], start: int, length: int) -> tuple[int, int]:
    """The start of a run after its first rows with other numbers beside a label (`Length;12;12`), and the number of
    those rows."""
    run = [index for index in range(start, len(rows)) if index not in comments and not is_blank(rows[index])][:length]
    usual = rows[run[length // 2]] if run else ()
    others = (k for k, at in enumerate(run) if not (is_footer(rows[at], usual) or _numbers_columns(rows[at], usual)))
    labelled = next(others, 0)
    return (run[labelled], labelled) if run else (start, 0)


def _numbers_columns(row: Row, usual: Row) -> bool:
    """Whether a row counts the columns, as whole numbers where a `usual` row has others too."""
    counts = [*shown(row)] == [str(k + 1) for k in range(len(row))]
    return counts and len(row) > 2 and len(row) >= len(usual) and not all(map(str.isdecimal, shown(usual)))


def is_blank(row: Row) -> bool:
    """Whether all cells of a row are empty."""
    return all(cell is None or cell == "" for cell in row)


def is_value(cell: Any) -> bool:
    """Whether a cell is a number or a point in time, or a formula without a computed value."""
    if isinstance(cell, str):
        if cell[:1] == "=" != cell:
            return True
        return bool(cell) and (NUMERIC.fullmatch(cell) is not None or is_stamp(cell) or bool(with_unit_apart(cell)[1]))
    return cell is not None and not isinstance(cell, bool)


def _has_values(row: Row) -> bool:
    """Whether a row holds values, in contrast to a row of units with some multiples (`s;bar;0.01 Nm`)."""
    values = [is_value(cell) for cell in row if cell not in (None, "")]
    return any(values) and (all(values) or not _are_units(row))


def refuse_factors(above: Sequence[Sequence[str]]) -> None:
    """Raise InvalidError if a line above the data has factors of the columns, which may or may not be applied already."""
    for index, row in enumerate(above):
        for place, cell in enumerate(row[1:], 1):
            below = [other[place] for other in above[index + 1 :] if len(other) > place]
            under = [number for number in below if NUMBER.fullmatch(number)]
            if _FACTORS.match(cell) and len(under) > 1 and {*map(float, under)} != {1.0}:
                row = (cell, *under)
        numbers = [cell for cell in row[1:] if NUMBER.fullmatch(cell.replace(",", "."))]
        factors = [cell for cell in numbers if float(cell.replace(",", ".")) != 1]
        if len(numbers) > 1 and factors and _FACTORS.match(row[0]):
            what = f"the line {row[0][:MAX_QUOTED]!r} holds factors, such as {factors[0]}"
            ask = "are the values already multiplied? If so, delete this line; if not, multiply them first"
            raise InvalidError.of(f"{what}: {ask}", code="raw_counts")


def is_footer(row: Row, other: Row) -> bool:
    """Whether a row does not belong to the table of the row `other`: it begins with a word where `other` has a value or
    nothing, or has no value at all."""
    place, cell = next(((place, cell) for place, cell in enumerate(row) if cell not in (None, "")), (0, None))
    if cell is None or is_value(cell) or is_ditto(cell):
        return False
    neighbour = other[place] if place < len(other) else None
    return neighbour in (None, "") or is_value(neighbour) or not any(map(is_value, row))


def _is_moment(cell: Any) -> bool:
    """Whether a cell is a point in time or a duration, which needs no unit."""
    return is_stamp(cell) if isinstance(cell, str) else hasattr(cell, "resolution")


def _is_word(title: str, cell: Any) -> bool:
    """Whether a cell in a time column is a word, so that a missing unit is not the problem."""
    return isinstance(cell, str) and bool(cell) and not is_value(cell) and known_channel(title) == "time_s"


def _layout(
    rows: Sequence[Row], comments: frozenset[int], start: int, length: int, named: Sequence[str]
) -> Layout | None:
    """The layout of the data from row `start` on; the titles are the row above with most known channels."""
    start, labelled = _skip_labelled_rows(rows[:-1], comments, start, length)
    above = _text_rows_above(rows, comments, start)
    width = max((index + 1 for index, cell in enumerate(rows[start]) if cell not in (None, "")), default=0)
    data = [row for row in rows[start : start + length] if not is_blank(row)][:_LONG_RUN]
    best: tuple[tuple[int, int, int], list[str], int] | None = None
    for place, at in enumerate(above):
        if width > 1 and _states_value(rows[at]):
            continue
        for titles in _titles(rows, above[place:], width, data):
            filled = sum(map(bool, titles))
            with_units = _beside_units(titles, rows[at + 1], rows[at - 1] if at else ())
            channel_count = 0 if _are_units(titles) else recognised(with_units, named)  # `rpm` is both
            enough = (
                filled + (titles[:1] == [""]) >= width if at in comments else filled >= min(2, width) or channel_count
            )
            rank = (
                channel_count,
                -abs(len(titles) - width) - LONGEST_TITLE * (max(map(len, titles), default=0) > LONGEST_TITLE),
                int(not _are_units(titles)),
            )
            if enough and (best is None or rank > best[0]):
                best = rank, titles, at
    crossing = start - 1 if labelled and _crosses(rows[start - 1], rows[start]) else None
    if crossing is not None and (best is None or best[0][0] + best[0][1] <= 1):
        corner, *cells = shown(rows[crossing])
        best = (2, 0, 1), [CORNER.split(corner)[0], *cells], crossing
        labelled = 0
    if best is None:
        return None
    rank, titles, at = best
    units = [] if at == crossing else _units(rows, [row for row in above if row > at], at, start, titles, width)
    twice = len(set(filter(None, titles))) < sum(map(bool, titles))
    over_groups = (
        at > 0
        and not _are_units(rows[at - 1])
        and (at - 1 in above or (twice and not all(NUMBER.fullmatch(_text(cell)) for cell in rows[at - 1] if cell)))
    )
    groups = _filled([_text(cell) for cell in rows[at - 1]], len(titles)) if over_groups else []
    extra_rows = (units[: len(titles)], groups if twice else (), rows[start][: len(titles)])
    headings = tuple(zip_longest(titles, *extra_rows, fillvalue=""))
    misfits = sum(bool(unit) and not _fits(title, unit) for title, unit, _, _ in headings)
    score = (rank[0] - misfits, rank[1], min(length - labelled, _LONG_RUN), sum(map(is_value, rows[start])))
    return Layout(headings=headings, titles=at, start=start, labelled=labelled, score=score)


def _beside_units(titles: Sequence[str], *beside: Row) -> Sequence[str]:
    """Titles with the units of the first row beside them that holds nothing else."""
    row = next(filter(_are_units, beside), ())
    pairs = zip_longest(titles, map(_text, row[: len(titles)]), fillvalue="")
    stated = [bool(title and is_unit(bare_unit(unit) or "") and not _BRACKETS.search(title)) for title, unit in pairs]
    return [
        f"{title} [{row[at]}]" if own else title for at, (title, own) in enumerate(zip(titles, stated, strict=True))
    ]


def _states_value(row: Row) -> bool:
    """Whether a row is one cell that states a value (`p = 4 bar`), which is a block's head and no title."""
    texts = list(filter(None, map(_text, row)))
    return len(texts) == 1 and re.search(r"[=: ]\s*\d", texts[0]) is not None and _BRACKETS.search(texts[0]) is None


def _crosses(row: Row, below: Row) -> bool:
    """Whether a row is the head of a two-way table (`Speed [rpm];2;4;6`): a word, then rising or falling numbers, one
    over each column."""
    cells = [with_unit_apart(cell)[0] for cell in row[1:]]
    texts = [str(cell).strip().replace(",", ".") for cell in cells]
    if len(row) != len(below) or len(cells) < 2 or is_value(row[0]) or not all(map(NUMBER.fullmatch, texts)):
        return False
    signs = {b > a for a, b in pairwise(map(float, texts))} if len(set(texts)) == len(texts) else set()
    return len(signs) == 1


def _text_rows_above(rows: Sequence[Row], comments: frozenset[int], start: int) -> list[int]:
    """The nearest rows of text above the data, the lowest first. Numbers with a label (`Length;12;12`), and those of the
    columns, may stand between them."""
    text_rows: list[int] = []
    for index in range(start - 1, -1, -1):
        row = rows[index]
        if index in comments or not _has_values(row) or _names_levels(row, rows[start]):
            text_rows += [] if is_blank(row) else [index]
        elif not is_footer(row, rows[start]) and not _numbers_columns(row, rows[start]):
            break
        if len(text_rows) == _MAX_TITLE_ROWS:
            break
    return text_rows


def _names_levels(row: Row, below: Row) -> bool:
    """Whether a row over numbers has several values with their units, and no other numbers: `;4 bar;5 bar`."""
    values = [bool(with_unit_apart(cell)[1]) for cell in row if cell not in (None, "") and is_value(cell)]
    return len(values) > 1 and all(values) and not any(with_unit_apart(cell)[1] for cell in below)


def _titles(rows: Sequence[Row], upwards: Sequence[int], width: int, data: Sequence[Row]) -> Iterator[list[str]]:
    """The possible titles from a row: its own texts, those of all columns but the first, with gaps filled from above,
    and both rows' texts joined."""
    titles_row = [_text(cell) for cell in rows[upwards[0]]]
    while titles_row and not titles_row[-1]:
        titles_row.pop()
    yield titles_row
    if _are_units(titles_row):
        return
    if len(titles_row) == width - 1 and _have_names(data, titles_row):
        yield ["", *titles_row]
    for row in upwards[1:2] if len(titles_row) > 1 else upwards[1:]:
        above = [_text(cell) for cell in rows[row]]
        if sum(map(bool, above)) < 2 or (len(titles_row) < 2 and _are_units(above)):
            continue
        size = max(len(titles_row), min(len(above), width))
        padded = titles_row + [""] * (size - len(titles_row))
        above += [""] * (size - len(above))
        yield [_of_both(name, other) for name, other in zip(padded, above, strict=False)]
        yield [
            name if other == name else f"{other} {name}".strip()
            for name, other in zip(padded, _filled(above, size), strict=False)
        ]


def _of_both(name: str, above: str) -> str:
    """A title of two cells: the one above where `name` is empty or its unit."""
    if not above or is_unit(above) or not (is_unit(bare_unit(name) or "") or not name):
        return name or above
    return f"{above} [{bare_unit(name)}]" if name and not _BRACKETS.search(above) else above


def _have_names(rows: Sequence[Row], titles: Sequence[str]) -> bool:
    """Whether rows of data begin with a name that no title stands above, as R writes them: a word, or numbers that count
    where the first title is that of a quantity that counts nothing, or the column after that of the times runs on as times
    do."""
    first = [_text(row[0]) for row in rows]
    if len(first) < 2 or not any(map(is_value, first)):
        return len(first) > 1 and all(first)
    named = [column_of(title[:LONGEST_TITLE]) for title in titles]
    channels = [meaning(column.name, column.unit)[0] for column in named]
    if not all(cell.isdecimal() and len(cell) < LONGEST_UNIT for cell in first):
        return False
    counts = all(int(b) == int(a) + 1 for a, b in pairwise(first))
    if "time_s" not in channels:  # neither a pressure nor a speed nor a torque counts the rows
        return counts and first[0] == "1" and len(first) == _LONG_RUN and channels[0] is not None
    at = channels.index("time_s") + 1
    numbers = [_text(row[at]).replace(",", ".") for row in rows if len(row) == len(titles) + 1]
    runs_on = all(map(NUMBER.fullmatch, numbers)) and all(b > a for a, b in pairwise(map(float, numbers)))
    return counts and runs_on and len(numbers) == len(rows)


def _filled(texts: Sequence[str], size: int) -> list[str]:
    """The texts of merged cells, each repeated over the empty cells after it."""
    filled = [*texts, *[""] * size][:size]
    for place in range(1, size):
        filled[place] = filled[place] or filled[place - 1]
    return filled


def _text(cell: Any) -> str:
    return "" if cell is None else str(cell).strip()


def _are_units(row: Row) -> bool:
    """Whether all texts are units, with or without words that say so."""
    texts = (text for text in map(_text, row) if not _UNIT_LABELS.fullmatch(text))
    stated = [unit for unit in map(bare_unit, texts) if unit]
    return bool(stated) and all(map(is_unit, stated))


def _units(
    rows: Sequence[Row], below: Sequence[int], at: int, start: int, titles: Sequence[str], width: int
) -> list[str]:
    """The units of the titles in row `at`: from the rows below it, one above it, or rows labelled as units, the row and
    assignment that fits most titles."""
    texts = {index: [_text(cell) for cell in rows[index]] for index in range(max(0, start - MAX_ROWS), start)}
    labelled = [index for index, row in texts.items() if row and _UNIT_LABELS.fullmatch(row[0])]
    over = [at - 1] if at and _are_units(texts[at - 1]) else []
    best: Sequence[str] = []
    for index in (*below, *over, *labelled):
        if index != at and texts[index] != texts[at]:
            placements = _placements_of_units(texts[index], titles, width)
            best = max(best, *placements, key=lambda units: sum(map(_fits, titles, units)))
    return ["" if _UNIT_LABELS.fullmatch(unit) else unit for unit in best]


def _placements_of_units(units: Sequence[str], titles: Sequence[str], width: int) -> Iterator[Sequence[str]]:
    """The possible assignments of a row of units to the titles: each under its own title; or, if all fit, one after the
    other to all known columns, with or without the time, because some writers leave out columns without a unit."""
    yield units
    stated = [unit for unit in units if unit and not _UNIT_LABELS.fullmatch(unit)]
    channels = [known_channel(column_of(title).name) if len(title) <= LONGEST_TITLE else None for title in titles]
    for unitless in (None,), (None, "time_s"):
        places = [place for place, channel in enumerate(channels) if channel not in unitless]
        in_order = dict(zip(places, stated, strict=False))
        fits = all(_fits(titles[place], unit) for place, unit in in_order.items())
        if fits and len(places) == len(stated) and places[-1:] < [width]:
            yield [in_order.get(place, "") for place in range(len(titles))]


def _fits(title: str, cell: str) -> bool:
    """Whether a cell is a unit of its title's channel, or any unit if the title is unknown."""
    unit, channel = bare_unit(cell) or "", known_channel(title)
    return is_unit(unit) if channel is None else conversion(channel, unit) is not None


def turned(rows: Sequence[Row], named: Sequence[str]) -> tuple[list[Row], Layout] | None:
    """The rows of a table with one channel per line, transposed, and its layout; None if the table is not of this form."""
    on_its_side: list[Row] = list(zip_longest(*rows, fillvalue=""))
    layout = find_table(on_its_side[:MAX_ROWS], frozenset(), named) if len(on_its_side) > 2 else None
    upright = max((recognised(list(map(_text, row)), named) for row in rows[:MAX_ROWS]), default=0)
    return None if layout is None or layout.score[0] < upright else (on_its_side, layout)


def no_table(rows: Sequence[Row], named: Sequence[str]) -> InvalidError:
    """The error for a text or sheet without a row of titles over numbers; it quotes the rows in question."""
    filled = [index for index, row in enumerate(rows) if not is_blank(row)] or [0]
    best = max(filled, key=lambda index: recognised(list(map(_text, rows[index])), named) if rows else 0)
    under = next((index for index in filled if index > best), None)
    if under is not None and recognised(list(map(_text, rows[best])), named):
        place, rule = under, f"a row of numbers, under the titles of line {best + 1}"
    else:
        place, rule = filled[0], "a header with the channels' names, above rows of numbers"
    got = " ".join(map(_text, rows[place] if rows else ())).strip()[:MAX_QUOTED]
    return InvalidError.of(f"line {place + 1} must be {rule}, got {got!r}", code="no_header", value=got)
