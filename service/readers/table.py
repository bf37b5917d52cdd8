"""A table as it stands in a file, and how a caller wants it read: what every reader makes and `channels` takes.

A reader finds the table and says what the file says: titles, units, clocks. It decides nothing of channels.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from numpy.typing import NDArray

from models.arrays import FloatArray
from service.channels import LineOf
from service.errors import MAX_QUOTED, InvalidError, Notice
from service.readers.unit_table import is_unit

#: The time option that takes no clock: each row is a plateau.
NO_TIME = "none"
#: The titles of a channel whose values stand in the titles of columns, or in the names of a file's parts (sheets, groups,
#: archived files, lines above blocks), and of one whose values fill the cells under such titles.
COLUMNS, SHEETS, CELLS = "=columns", "=sheets", "=cells"
#: The table option by which all parts of a file are read, one below the other.
ALL = "*"
#: The option of missing values by which every number is a measurement; the mark by which an empty cell holds what stands
#: above it, as merged cells do.
NO_MISSING, ABOVE = "none", "above"


def is_per_column(name: str) -> bool:
    """Whether a choice is a constant of one column (`=5@torque_5bar`), or several of them separated by commas."""
    return name.startswith("=") and "@" in name


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnChoice:
    """The column of a channel: its title, or a constant's text (`constants`), and its unit; value = factor · converted
    + offset, in the channel's unit.

    `unit` replaces the file's unit, which must be that unit or `stated`; None: the file's own.
    """

    column: str
    unit: str | None = None
    stated: str | None = None
    factor: float = 1.0
    offset: float = 0.0

    def is_constant(self) -> bool:
        """Whether it names a value in place of a column: `=5 bar`, or `=LABEL` for the text beside a label above the
        table."""
        pseudo = self.column in (COLUMNS, SHEETS, CELLS) or is_per_column(self.column)
        return self.column.startswith("=") and not pseudo


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """How to read a file; empty if the file states everything itself. A rig profile keeps one.

    `mapping`: channel -> its column; `only_named`: no other column is taken. `left_out`: titles that are left out on
    purpose. `table`: the sheet, group or archived file, or ALL. `time`: the title of the time column, or NO_TIME. `decimal`:
    the decimal sign, "." or ",". `skip_rows`: lines above that are not looked at. `missing`: marks of values that are
    missing, such as `-9999,n/a`, of one channel as `torque_nm:0`; where any is given, rows without a value are left out;
    ABOVE: empty cells hold what stands above them; NO_MISSING: every number is a measurement.
    `good`: codes of a column of qualities that mark good rows, such as `0` or `192`; NO_MISSING: all rows are read.
    """

    mapping: Mapping[str, ColumnChoice] = field(default_factory=dict)
    only_named: bool = False
    left_out: Sequence[str] = field(default_factory=list)
    table: str = ""
    time: str = ""
    decimal: str = ""
    skip_rows: int = 0
    missing: str = ""
    good: str = ""

    def reads_all(self) -> bool:
        """Whether all parts of a file are read and appended to each other."""
        return self.table == ALL or any(choice.column == SHEETS for choice in self.mapping.values())


@dataclass(frozen=True, slots=True)
class Clock:
    """The times of a column by the recorder's own clock. Columns whose `key` is equal share it; `read` gives [n] s.

    `counts`: the clock may be a default that only counts samples, a second each. `own`: the file states it for this column,
    whatever columns of times stand beside it.
    """

    key: object
    read: Callable[[], FloatArray]
    counts: bool = False
    own: bool = False


@dataclass(frozen=True, slots=True)
class FileColumn:
    """One column of a file: its name without a unit, and the unit that the file states (None: it states none).

    `group` distinguishes equal names in files that have groups; a map may use `group/name`. `title` is the text of the
    file; `rows` is None where the length is known only when the values are read.
    """

    name: str
    unit: str | None = None
    group: str = ""
    title: str = ""
    rows: int | None = None
    clock: Clock | None = None

    def shown(self) -> str:
        """The column's name for a message."""
        return f"{self.group}/{self.name}"[:MAX_QUOTED] if self.group else self.name[:MAX_QUOTED]


#: Reads columns [n] by their index, each with the channel that it is for: `time_s` may be points in time, and errors name
#: it. Numbers come as any numeric type, points in time as datetime64 or timedelta64, cells of any kind as texts or objects;
#: a masked array marks the samples that the recorder says are invalid.
Values = Callable[[Mapping[int, str]], Sequence[NDArray[Any]]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table as read. `above`: the lines over it; `first_line`: where its data begin (None: the format has no lines);
    `head`: its first rows as text. Of several blocks below each other, with the same titles, `breaks` has the first row of
    each but one, and `heads` the lines over each. `parts`: all tables of the file, of which this is the first, where it is
    read by ALL. `line_of`, `breaks`, `heads` and `notices` hold once the values are read."""

    columns: tuple[FileColumn, ...]
    read: Values
    name: str = ""
    others: tuple[str, ...] = ()
    above: tuple[tuple[str, ...], ...] = ()
    first_line: int | None = None
    head: tuple[tuple[str, ...], ...] = ()
    line_of: LineOf | None = None
    breaks: Sequence[int] = ()
    heads: Sequence[Sequence[Sequence[str]]] = ()
    notices: Sequence[Notice] = ()
    parts: "tuple[Table, ...]" = ()


def marks(missing: str, channel: str = "") -> list[str]:
    """The marks in a list such as `-9999,torque_nm:0` that hold for all channels, and those of one `channel`, in lower
    case."""
    if missing == NO_MISSING:
        return []
    stated = [mark.strip().casefold() for mark in missing.split(",") if mark.strip()]
    return [
        mark.removeprefix(f"{channel}:")
        for mark in stated
        if ":" not in mark or (channel and mark.startswith(f"{channel}:"))
    ]


def fills_down(missing: str) -> bool:
    """Whether an empty cell repeats the value above it."""
    return ABOVE in marks(missing)


def labels(above: Sequence[Sequence[str]]) -> dict[str, str]:
    """Labels and their values from the lines above a table: `label: value`, `label = value`, or label, value and unit
    in cells."""
    values_by_label: dict[str, str] = {}
    for row in above:
        cells = [cell for cell in row if cell]
        if len(cells) == 1:
            cells = [part.strip() for part in re.split(r"[:=]", cells[0], maxsplit=1)]
        elif len(cells) == 3 and is_unit(cells[2]):
            cells = [cells[0], f"{cells[1]} {cells[2]}"]
        if len(cells) > 1 and cells[1]:
            values_by_label.setdefault(cells[0][:MAX_QUOTED], cells[1][:MAX_QUOTED])
    return values_by_label


def index_of_wanted(names: Sequence[str], wanted: str, kind: str) -> int:
    """The index in `names` of the table to read: the one `wanted` by name or by number from 1, else the only one.

    Raises InvalidError where that leaves none or several; `kind` is what the message calls one (sheet, group).
    """
    if wanted:
        if wanted in names:
            return names.index(wanted)
        if wanted.isdecimal() and 1 <= int(wanted) <= len(names):
            return int(wanted) - 1
    elif len(names) == 1:
        return 0
    shown = ", ".join(repr(name[:MAX_QUOTED]) for name in names[:10]) + (" ..." if len(names) > 10 else "")
    missing = f"has no {kind} {wanted[:MAX_QUOTED]!r}" if wanted else f"holds {len(names)} {kind}s with channels"
    message = f"the file {missing}: choose one with table=NAME, from {shown}"
    raise InvalidError.of(message, code="which_table", pointer="/table", value=names[0] if names else "")


def cut_short(defect: str) -> InvalidError:
    """The error for a file with its end missing."""
    message = f"the end of the file is missing: {defect}. Send the complete file"
    return InvalidError.of(message, code="truncated")
