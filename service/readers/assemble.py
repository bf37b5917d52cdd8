"""A table as read -> a run's channels: columns chosen, units converted, all on one clock, invalid samples left out.

What was left out or resampled is in the notices. Each column has its own time: the time column before it in its group, else
its recorder's clock, else the one time column of the table.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import zip_longest
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.records.cleaning import stands
from service.channels import LineOf, check_columns, place
from service.errors import MAX_QUOTED, InvalidError, Notice, TooLargeError
from service.readers.column_names import (
    Taken,
    choices_of,
    choose,
    is_counter,
    like_a_time,
    may_be_time,
    no_unit,
    part_of_second,
    perhaps_the_time,
    several_times,
)
from service.readers.constants import constants, stated_step
from service.readers.limits import Limits
from service.readers.long_table import in_columns, says_valid, valid_rows
from service.readers.meanings import known_channel
from service.readers.missing_values import (
    drop_totals,
    mask_stated_marks,
    refuse_no_torque,
    refuse_stand_ins,
)
from service.readers.numerals import empty_cells, plain, read_cells
from service.readers.slips import refuse_slips
from service.readers.stated_clocks import evenly
from service.readers.table import ABOVE, NO_MISSING, NO_TIME, Clock, FileColumn, Reading, Table, index_of_wanted, labels
from service.readers.unit_table import conversion

#: The code of the notice that lists unused columns.
LEFT_OUT = "columns_left_out"
_SECOND = np.timedelta64(1, "s")
#: The channel on whose clock the others are brought, the first that is there.
_LEADING = ("torque_nm", "speed_rpm", "pressure_bar")
#: Steps of the time that repeated titles may interrupt a table for. Chosen: a printed page takes none, a new test minutes.
_LONGEST_PAUSE = 10
#: A second, in days; as a step in seconds, less than rigs sample at.
_SECOND_OF_DAY = 1.2e-5
#: Seconds since 1970 of 2000 and 2100. In nanoseconds, .NET's ticks of that time would be of 1990.
_OUR_TIME = np.array([9.46e8, 4.1e9])
#: What computers count since when: Unix, Windows' file times, .NET's ticks.
_COUNTED = {"ms since 1970": 1e3, "µs since 1970": 1e6, "ns since 1970": 1e9}
_COUNTED |= {"100 ns since 1601": 1e7, "100 ns since 0001": 1e7}
#: Empty cells that show a channel of a lower rate. Chosen: fewer may have been left empty by hand.
_MIN_GAPS = 4
#: Values of a channel that are fewer than those of one that was recorded at a lower rate. Chosen: levels of a test.
_FEW = 20
#: The share of a clock's steps that go on. Chosen: times that are rounded to half a step stand still at every second.
_MOST_OF = 0.9
#: Columns that one notice names.
_MAX_NAMED = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class Channels:
    """Channels [n] by public name in their units. `counts`: the time may be a recorder's default that only counts
    samples; `labels`: words above the table -> the text beside them."""

    columns: dict[str, FloatArray]
    notices: tuple[Notice, ...] = ()
    counts: bool = False
    labels: Mapping[str, str] = field(default_factory=dict)


@dataclass(slots=True)
class _Series:
    """A channel: its values, its times (None: none stated), which samples are valid, and the name of its clock."""

    values: FloatArray
    valid: NDArray[np.bool_] | None
    clock: object
    times: FloatArray | None


def to_channels(table: Table, reading: Reading, limits: Limits) -> Channels:
    """The channels chosen by their names and `reading`.

    Raises InvalidError if a unit or a clock is ambiguous, a value is no number, or no channel is known; TooLargeError
    on too many values.
    """
    if table.parts:
        return below_each_other([to_channels(replace(part, parts=()), reading, limits) for part in table.parts])
    table, reading = in_columns(table, reading)
    constant, step = constants(table, reading), stated_step(table, reading)
    chosen = choose(table.columns, reading)
    series, table, counts = _read(table, chosen, reading, limits)
    notices = list(table.notices)
    columns = _on_one_clock(series, notices)
    columns, first = _chosen_table(columns, table, reading)
    size = next(iter(columns.values())).size
    columns |= {channel: np.full(size, value) for channel, value in constant.items()}
    if step is not None:
        columns["time_s"] = evenly(0.0, step, size)
    if reading.reads_all() and "time_s" in columns:
        columns["time_s"] = _continued(columns["time_s"])
    line_in_file = table.line_of
    line_of = None if line_in_file is None else lambda row: line_in_file(first + row)
    try:
        check_columns(columns, line_of=line_of)
    except InvalidError as error:
        value = error.errors[0].value if error.errors and error.errors[0].code == "not_finite" else ""
        if not value:
            raise
        detail = f"{error.detail}: add missing={value} to leave such rows out"
        raise InvalidError(detail, errors=error.errors, total=error.total) from None
    _refuse_standing(columns)
    refuse_no_torque(columns, line_of, reading)
    refuse_slips(columns, line_of, reading)
    return Channels(columns=columns, notices=tuple(notices), counts=counts, labels=labels(table.above))


def below_each_other(parts: Sequence[Channels]) -> Channels:
    """The parts' common channels appended one after the other, with continued times. Raises InvalidError if the parts
    have no channels in common."""
    names = [name for name in (parts[0].columns if parts else ()) if all(name in part.columns for part in parts)]
    columns = {name: np.concatenate([part.columns[name] for part in parts]) for name in names}
    if not columns:
        message = "the parts of the file have no channel in common: choose one with table=NAME"
        raise InvalidError.of(message, code="which_table", pointer="/table")
    if "time_s" in columns:
        columns["time_s"] = _continued(columns["time_s"])
    notices = tuple(dict.fromkeys(notice for part in parts for notice in part.notices))
    message = f"{len(parts)} parts of the file were read one below the other"
    notices += (Notice(code="stacked", message=message),)
    return Channels(columns=columns, notices=notices, counts=all(part.counts for part in parts), labels=parts[0].labels)


def _continued(times: FloatArray) -> FloatArray:
    """Times [n] that restart with each part of a file, continued as those of one record."""
    steps = np.diff(times)
    back = steps < 0
    usual = float(np.median(steps[~back])) if not back.all() else 1.0
    shifts = np.where(back, usual - steps, 0.0)
    return times + np.concatenate([[0.0], np.cumsum(shifts)]) if back.any() else times


def _refuse_standing(columns: Mapping[str, FloatArray]) -> None:
    """Raise InvalidError if the time stays the same from row to row: a clock coarser than the rows is no clock."""
    time_s = columns.get("time_s")
    if time_s is None or len(columns) == 1 or not stands(time_s):
        return
    still = np.count_nonzero(np.diff(time_s) == 0)
    message = (
        f"time_s does not advance in {still} of {time_s.size - 1} steps: the clock is coarser than the rows. Name a "
        f"column of finer times with time=NAME; if each row is a plateau, send time={NO_TIME}"
    )
    raise InvalidError.of(message, code="time_stands", pointer="/channels/time_s")


def _chosen_table(columns: dict[str, FloatArray], table: Table, reading: Reading) -> tuple[dict[str, FloatArray], int]:
    """The one table, or of several below each other the one that is named by its number (`2`, `Sheet/2`), and its first row.

    Titles that only interrupt a table, whose time goes on after them, begin no other; where one is named, a clock that goes
    back does.
    """
    if reading.reads_all():
        return columns, 0
    time_s, breaks = columns.get("time_s"), table.breaks
    size = next(iter(columns.values())).size
    if not breaks and time_s is not None and reading.table not in ("", table.name) and not table.others:
        breaks = (np.flatnonzero(np.diff(time_s) < 0) + 1).tolist()
    starts = [0, *breaks, size]
    tables = [f"{table.name}/{number}" if table.name else str(number) for number in range(1, len(starts))]
    if table.breaks and time_s is not None and reading.table not in tables:
        steps = np.diff(time_s)
        # rows that are left out may leave fewer than stood above a title
        within = all(0 < row <= steps.size for row in breaks)
        if within and all(0 < steps[row - 1] < _LONGEST_PAUSE * np.median(steps) for row in breaks):
            return columns, 0
    asked_table = reading.table if breaks and reading.table != table.name else ""
    number = index_of_wanted(tables, asked_table, "table")
    return {name: column[starts[number] : starts[number + 1]] for name, column in columns.items()}, starts[number]


def _clocks(
    columns: Sequence[FileColumn], taken: Sequence[Taken], values: Mapping[int, FloatArray]
) -> dict[int, Clock | None]:
    """The clock of each column taken that is no time itself: the one stated for it, a column of times, its recorder's,
    or none."""
    all_times = {column.index: _column_clock(columns, column, values) for column in taken if column.channel == "time_s"}
    named = {at: column.index for column in taken for at in column.clock_of}
    times = {at: clock for at, clock in all_times.items() if at not in named.values()} or all_times
    clocks: dict[int, Clock | None] = {}
    coarse: dict[int, bool] = {}
    for index in (column.index for column in taken if column.channel != "time_s"):
        recorder = columns[index].clock
        if index in named or (recorder is not None and recorder.own):
            clocks[index] = all_times[named[index]] if index in named else recorder
            continue
        of_group = [at for at in times if columns[at].group == columns[index].group]
        if of_group:
            chosen = max((at for at in of_group if at < index), default=of_group[0])
            if recorder is not None and chosen not in coarse:
                coarse[chosen] = _repeats(values[chosen])
            finer = (
                recorder
                if recorder is not None and coarse[chosen] and _agree(recorder.read(), values[chosen])
                else None
            )
            clocks[index] = finer or times[chosen]
        else:
            clocks[index] = recorder or (next(iter(times.values())) if len(times) == 1 else None)
    for unused, following in (
        zip_longest(times, [*times][1:]) if not clocks or {*times.values()} & {*clocks.values()} else ()
    ):
        if len(times) == 1 or times[unused] in clocks.values():
            continue
        if following is None or not _agree(values[unused], values[following]):
            shown = " and ".join(columns[index].title or columns[index].shown() for index in [*times][:_MAX_NAMED])
            raise several_times(shown)
        if np.unique(values[unused]).size > np.unique(values[following]).size:
            clocks = {at: times[unused] if clock is times[following] else clock for at, clock in clocks.items()}
    return clocks


def _may_be_clocks(table: Table, channels: Mapping[int, str], reading: Reading) -> list[int]:
    """The columns that may be the time of a channel, or of all channels if no column is the time; empty if the caller
    named one."""
    if reading.time == NO_TIME or reading.only_named or "time_s" in choices_of(reading):
        return []
    others = [(at, own) for at, own in enumerate(table.columns) if at not in channels]
    if "time_s" in channels.values():
        return [at for at, own in others if may_be_time(own)]
    # a caller who named columns knows those whose names say nothing
    return [at for at, own in others if like_a_time(own) and not (reading.mapping and may_be_time(own))]


def as_seconds(column: FileColumn, values: NDArray[Any]) -> FloatArray:
    """A possible time column in s; one without a unit unchanged."""
    if values.dtype.kind in "Mm":
        return np.asarray((values - values[:1]) / _SECOND, dtype=np.float64)
    converted = conversion("time_s", column.unit or "s")
    return plain(values) * (1.0 if converted is None else converted.factor)


def _repeats(times: FloatArray) -> bool:
    """Whether any time occurs in more than one row."""
    steps = np.diff(times)
    return not (steps > 0).all() and np.unique(times).size < times.size


def _refuse_passed_over(column: FileColumn, seconds: FloatArray, clocks: Mapping[int, Clock | None]) -> None:
    """Raise InvalidError if an unused column may be a time: it runs on and there is no other clock, or it runs like a
    used clock and begins within its record at another time, so that it may belong to a channel."""
    if not any(clocks.values()) and runs_on(column, seconds):
        raise perhaps_the_time(column)
    all_used = [clock.read() for clock in {id(own): own for own in clocks.values() if own is not None}.values()]
    if any(np.array_equal(used, seconds) for used in all_used):
        return  # the array of one of these clocks
    for used in all_used:
        if used.size != seconds.size or used.size < 2 or not runs_on(column, seconds):
            continue
        shift = abs(float(seconds[0] - used[0]))
        if _agree(seconds, used) and _step(used) / 2 < shift < float(np.ptp(used)):
            raise several_times(f"those of the clock and {column.title or column.shown()}, {shift:g} s apart")


def _column_clock(columns: Sequence[FileColumn], column: Taken, values: Mapping[int, FloatArray]) -> Clock:
    """A column as a clock. LabVIEW's text files number their rows where they have no clock, so a column of whole
    numbers from 0 may be a sample counter (`counts`)."""
    times = values[column.index]
    counts = is_counter(columns[column.index]) and np.array_equal(times, np.arange(times.size))
    return Clock(column.index, lambda: times, counts=counts)


def _agree(times: FloatArray, others: FloatArray) -> bool:
    """Whether two columns show the same elapsed time, within the resolution of the coarser one."""
    if times.size != others.size:
        return False
    steps = [step[step > 0].min(initial=np.inf) for step in (np.diff(times), np.diff(others))]
    max_difference = np.abs(times - times[:1] - others + others[:1]).max(initial=0.0)
    return bool(max_difference <= max(steps) * (1 + 1e-9))


def runs_on(column: FileColumn, times: FloatArray) -> bool:
    """Whether a column may be a clock: nine of ten of its steps are forward, and without a title not all of them 1, as those
    of row numbers are. Chosen: of durations in any order half are."""
    steps = np.diff(times[~np.isnan(times)])
    forward = np.count_nonzero(steps > 0) >= _MOST_OF * steps.size
    return bool(steps.size > 0 and forward and (column.title or not (steps == 1).all()))


def _add_part(times: FloatArray, parts: Mapping[int, FloatArray]) -> int | None:
    """Add the fraction of the second, from a column of its own, to times in whole seconds, in place; returns that
    column."""
    for at, seconds in parts.items() if stands(times) else ():
        if ((seconds >= 0) & (seconds < 1)).all() and (np.diff(times + seconds) > 0).all():
            times += seconds - seconds[0]
            return at
    return None


def _read(
    table: Table, chosen: Sequence[Taken], reading: Reading, limits: Limits
) -> tuple[dict[str, _Series], Table, bool]:
    """The channels' values and times, without totals at the table's end, with notices, and whether the only clock may
    just count samples."""
    indices = [column.index for column in chosen]
    stated = sum(table.columns[index].rows or 0 for index in indices)
    if stated > limits.most_values:
        raise TooLargeError(f"a file must not hold more than {limits.most_values} values, got {stated}")
    channels = {column.index: column.channel for column in chosen}
    says = [index for index, column in enumerate(table.columns) if says_valid(column, reading)]
    parts = {}
    if reading.time != NO_TIME and "time_s" in channels.values():
        unused = {at: own for at, own in enumerate(table.columns) if at not in indices}
        parts = {at: factor for at, own in unused.items() if (factor := part_of_second(own))}
    timed = [at for at in _may_be_clocks(table, channels, reading) if at not in parts]
    beside = dict.fromkeys(says, "") | dict.fromkeys([*parts, *timed], "time_s")
    read = read_cells(table, beside | channels, reading)
    read |= {index: mask_stated_marks(read[index], reading, channels[index]) for index in indices}
    read, table = drop_totals(read, [column.index for column in chosen if column.channel != "time_s"], table)
    for column in chosen:
        refuse_stand_ins(column.channel, read[column.index], table.line_of, reading)
    values: dict[int, FloatArray] = {}
    valid: dict[int, NDArray[np.bool_] | None] = {}
    dated = [read[column.index] for column in chosen if read[column.index].dtype.kind == "M"]
    moments = {column.index for column in chosen if read[column.index].dtype.kind in "Mm"}
    start = min((moments[~np.isnat(moments)].min() for moments in dated if not np.isnat(moments).all()), default=None)
    notices = list(table.notices)
    for column in chosen:
        values[column.index], valid[column.index] = _numbers(column, read.pop(column.index), start)
        if column.channel == "time_s" and column.unit is None:
            notices += _in_seconds(table.columns[column.index], values[column.index], reading)
    part_seconds = {at: factor * plain(read.pop(at)) for at, factor in parts.items()}
    added = [_add_part(values[column.index], part_seconds) for column in chosen if column.channel == "time_s"]
    for name in (table.columns[at].shown() for at in added if at is not None):
        message = f"time_s has whole seconds: the fractions in {name} were added"
        notices.append(Notice(code="parts_of_seconds", message=message))
    clocks = {} if reading.time == NO_TIME else _clocks(table.columns, chosen, values)
    if len({clock.key in moments for clock in clocks.values() if clock is not None and clock.key in values}) > 1:
        raise several_times("points in time and numbers")
    other_times = {at: seconds for at, seconds in part_seconds.items() if at not in added and table.columns[at].unit}
    other_times |= {at: as_seconds(table.columns[at], read[at]) for at in timed}
    for at, seconds in other_times.items() if "time_s" not in choices_of(reading) else ():
        _refuse_passed_over(table.columns[at], seconds, clocks)
    used = {clock.key: clock for clock in clocks.values() if clock is not None}
    times = {key: clock.read() for key, clock in used.items()}
    marked = [valid_rows(table.columns[index], read[index], reading) for index in says if index in read]
    series = {}
    for column in chosen:
        if column.channel != "time_s":
            clock = clocks.get(column.index)
            key = None if clock is None else clock.key
            whole = _Series(values[column.index], valid[column.index], key, times.get(key))
            own = _drop_empty_rows(column.channel, whole, table, reading.missing not in ("", NO_MISSING))
            series[column.channel] = own
            for good in marked:
                if good is not None and good.size == own.values.size:
                    own.valid = good if own.valid is None else own.valid & good
    if not series:  # a time alone: shown as such, and refused for what it lacks
        series = {"time_s": _Series(values[indices[0]], None, None, None)}
    unread = {index: own for index, own in enumerate(table.columns) if index not in added}
    table = replace(table, notices=[*notices, *_left_out(unread, chosen, reading)])
    return series, table, len(used) == 1 and all(clock.counts for clock in used.values())


def _drop_empty_rows(name: str, own: _Series, table: Table, leave_out: bool) -> _Series:
    """A channel without the rows that hold neither it nor its time. Where at least every second of its cells is empty, its
    rate is lower than that of the rows: it is the samples that are there.

    `leave_out`: rows with any other empty cell are left out; else InvalidError is raised on them.
    """
    missing, invalid = np.isnan(own.values), own.valid
    if table.line_of is None and not leave_out and not missing.any():
        return own
    if table.line_of is not None and not leave_out:
        own.valid = None  # a cell's mask says that it is empty
    if own.times is not None and own.times.size == missing.size and not missing.all():
        timeless = np.isnan(own.times)
        keep = ~timeless if leave_out else ~(missing & timeless)
        gaps = np.count_nonzero(missing & keep)
        if gaps >= _MIN_GAPS and 2 * gaps >= np.count_nonzero(keep) - 1:
            if not leave_out and name in _LEADING and _is_held(missing[keep]):
                raise _which_is_empty(name, missing, table.line_of)
            keep &= ~missing
        if not keep.all():
            valid = None if own.valid is None else own.valid[keep]
            own = _Series(own.values[keep], valid, (own.clock, name), own.times[keep])
            missing, invalid = missing[keep], None if invalid is None else invalid[keep]
    if table.line_of is not None and not leave_out and invalid is not None and not invalid.all():
        if name in ("pressure_bar", "speed_rpm") and not missing[0] and 2 * np.count_nonzero(missing) > missing.size:
            raise _which_is_empty(name, missing, table.line_of)
        raise empty_cells(name, np.flatnonzero(~invalid).tolist(), table.line_of, missing.size - 1)
    if own.times is not None and table.line_of is not None and np.isnan(own.times).any():
        raise empty_cells("time_s", np.flatnonzero(np.isnan(own.times)).tolist(), table.line_of, own.times.size - 1)
    return own


def _is_held(missing: NDArray[np.bool_]) -> bool:
    """Whether a channel with this many empty cells [n] may hold its last value in them: it has few values, or none for
    long."""
    filled = np.flatnonzero(~missing)
    apart = np.diff([*filled, missing.size])
    return bool(filled.size < _FEW or apart.max() > _LONGEST_PAUSE * np.median(apart))


def _which_is_empty(name: str, missing: NDArray[np.bool_], line_of: LineOf | None) -> InvalidError:
    """The error for a channel with values in only some rows."""
    row = int(missing.argmax())
    message = (
        f"{place(name, row, line_of)} is empty, as in {np.count_nonzero(missing)} of {missing.size} rows. If an empty cell "
        f"holds the value above it, add missing={ABOVE}; to leave out such rows, or where the channel was recorded at a "
        "lower rate, add missing=empty"
    )
    return InvalidError.of(message, code="not_a_number", pointer=f"/channels/{name}/{row}", row=row + 1)


def _numbers(column: Taken, values: NDArray[Any], start: Any) -> tuple[FloatArray, NDArray[np.bool_] | None]:
    """Values in the channel's unit, and which of them are valid; points in time as seconds since `start`.

    Raises InvalidError on any other type.
    """
    mask = np.ma.getmaskarray(values) if isinstance(values, np.ma.MaskedArray) else None
    valid = ~mask if mask is not None and mask.any() else None
    values = np.asarray(values)
    if column.channel == "time_s" and values.dtype.kind in "Mm":
        since = values - start if values.dtype.kind == "M" and start is not None else values
        return np.where(np.isnat(since), np.nan, since / _SECOND), valid
    if values.dtype.kind not in "iuf" or values.ndim != 1:
        shown = f"values of type {values.dtype}" if values.ndim == 1 else f"{values.ndim} dimensions"
        message = f"{column.channel} must be a column of numbers, got {shown}"
        raise InvalidError.of(message, code="not_a_number", pointer=f"/channels/{column.channel}")
    numbers = np.array(values, dtype=np.float64) if values.dtype != np.float64 or not values.flags.writeable else values
    column.conversion.apply(numbers)
    return numbers, valid


def _in_seconds(column: FileColumn, times: FloatArray, reading: Reading) -> list[Notice]:
    """Convert times without a unit to seconds from the first, in place, if they are present-day dates only in one of a
    computer's units; returns the notice.

    Raises InvalidError where no map takes them for seconds, or where they may be days as spreadsheets or MATLAB count them:
    of our time since 1900 or the year 0, less than five of them, in steps that would be shorter than a rig samples.
    """
    for unit, factor in _COUNTED.items():
        first, last = _OUR_TIME + (np.datetime64("1970-01-01") - np.datetime64(f"{unit[-4:]}-01-01")) / _SECOND
        if times.size and times.min() / factor > first and times.max() / factor < last:
            times -= times[0]
            times /= factor
            message = f"{column.shown()} states no unit; its values were read as times in {unit}"
            return [Notice(code="unit_found", message=message)]
    name = column.title or column.name
    if "time_s" not in choices_of(reading):
        raise no_unit([("time_s", column)], reading)
    if times.size < 2:
        return []
    days = ((times > 20_000) & (times < 80_000)) | ((times > 700_000) & (times < 800_000))
    step = np.median(np.diff(times))
    fractions = times.min() >= 0 and times.max() <= 1 and 0 < step < _SECOND_OF_DAY
    if not fractions and not (days.all() and np.ptp(times) < 5 and step < 1e-3):
        return []
    message = (
        f"{column.shown()} states no unit: it begins at {times[0]:.9g} in steps of {step:.3g}, in seconds or days. "
        f"State the unit with map=time_s:{name} [s], or [d]"
    )
    raise InvalidError.of(message, code="missing_unit", pointer="/map")


def _left_out(columns: Mapping[int, FileColumn], taken: Sequence[Taken], reading: Reading) -> list[Notice]:
    """Notices about columns of the table that are not used."""
    notices = []
    used = {column.index for column in taken}
    others = [column for index, column in columns.items() if index not in used and column.title]
    others = [own for own in others if not {own.title, own.name, f"{own.group}/{own.name}"} & {*reading.left_out}]
    if reading.time == NO_TIME:
        others = [column for column in others if known_channel(column.name) != "time_s"]
    if others:
        names = ", ".join(column.shown() for column in others[:_MAX_NAMED])
        more = f" and {len(others) - _MAX_NAMED} more" if len(others) > _MAX_NAMED else ""
        message = f"columns left out, because their titles name no channel: {names}{more}"
        notices.append(Notice(code=LEFT_OUT, message=message))
    return notices


def _on_one_clock(series: Mapping[str, _Series], notices: list[Notice]) -> dict[str, FloatArray]:
    """The channels resampled on one `time_s`, if they have times, without invalid samples."""
    if "time_s" in series:
        return {"time_s": series["time_s"].values}
    leading = next((name for name in _LEADING if name in series), next(iter(series)))
    lead = series[leading]
    same = all(_same_clock(own, lead) for own in series.values())
    sizes = {own.values.size for own in series.values()}
    ragged = any(own.times is not None and own.times.size != own.values.size for own in series.values())
    if ragged or (len(sizes) > 1 if same else any(own.times is None for own in series.values())):
        rows = [f"{name} has {own.values.size}{' without times' * (own.times is None)}" for name, own in series.items()]
        message = f"channels without times of their own must have the same number of rows, got: {', '.join(rows)}"
        raise InvalidError.of(message, code="ragged")
    columns: dict[str, FloatArray] = {} if lead.times is None else {"time_s": lead.times}
    keep = np.ones(lead.values.size, dtype=np.bool_)
    invalid: dict[str, int] = {}
    for name, own in series.items():
        valid = own.valid
        if _same_clock(own, lead):
            columns[name] = own.values
        else:
            columns[name], valid, inside = _resampled(name, own, lead)
            keep &= inside
        if valid is not None:
            invalid[name] = int(np.count_nonzero(~valid))
            keep &= valid
    if not same:
        notices.append(_brought(series, leading, keep))
    if invalid:
        shown = ", ".join(f"{name} {count}" for name, count in invalid.items())
        message = f"samples with invalid values were left out of all channels; invalid values: {shown}"
        notices.append(Notice(code="invalid_samples", message=message))
    if keep.all():
        return columns
    if not keep.any():
        message = "no sample is left: at each time at least one channel has no valid value"
        raise InvalidError.of(f"{message}. Send channels recorded together", code="empty", pointer="/channels")
    return {name: column[keep] for name, column in columns.items()}


def _same_clock(series: _Series, other: _Series) -> bool:
    if series.times is None or other.times is None:
        return series.times is other.times
    return series.clock == other.clock or np.array_equal(series.times, other.times)


def _resampled(
    name: str, own: _Series, lead: _Series
) -> tuple[FloatArray, NDArray[np.bool_] | None, NDArray[np.bool_]]:
    """A channel linearly interpolated at the leading channel's times: values, which are valid, and which lie within its
    record."""
    assert own.times is not None  # noqa: S101 (seen to by the caller)
    assert lead.times is not None  # noqa: S101
    if own.times.size == 0 or not (np.diff(own.times) > 0).all():
        message = f"{name} has times of its own, which must increase from row to row"
        raise InvalidError.of(message, code="time_backwards", pointer=f"/channels/{name}")
    after = np.clip(np.searchsorted(own.times, lead.times), 1, max(own.times.size - 1, 1))
    valid = None
    if own.valid is not None and own.times.size > 1:
        valid = own.valid[after - 1] & own.valid[after]
    # a sample of a slower channel stands until the next one is due
    reach = max(0.0, _step(own.times) - _step(lead.times)) * (1 + 1e-9)
    inside = (lead.times >= own.times[0] - reach) & (lead.times <= own.times[-1] + reach)
    return np.interp(lead.times, own.times, own.values), valid, inside


def _step(times: FloatArray) -> float:
    """The distance between samples [s]."""
    return float(np.median(np.diff(times))) if times.size > 1 else 0.0


def _brought(series: Mapping[str, _Series], leading: str, kept: NDArray[np.bool_]) -> Notice:
    rates = []
    for name, own in series.items():
        if own.times is not None and not _same_clock(own, series[leading]):
            step = _step(own.times)
            rates.append(f"{name} ({own.values.size} samples, {step:.6g} s apart, from {own.times[0]:.9g} s)")
    message = f"interpolated to the times of {leading}: {', '.join(rates)[: 5 * MAX_QUOTED]}"
    if cut := int(np.count_nonzero(~kept)):
        why = "because not all channels were recorded at their times"
        message += f". {cut} of {kept.size} samples were left out, {why}"
    return Notice(code="brought_to_one_clock", message=message)
