"""What reading one file may cost. A file past a limit is refused with TooLargeError or InvalidError; values are chosen."""

from dataclasses import dataclass

from service.errors import InvalidError

#: Bytes of one line of CSV. Chosen; 1,000 columns of 60 characters fit.
LONGEST_LINE_BYTES = 1 << 16
#: Characters of a column's title, of a name that may be a channel's, and of a unit that may be known; longer names and units
#: are unknown. Chosen: three times the longest that is known, for blanks in it, and for a title what no recorder writes.
LONGEST_TITLE, LONGEST_NAME, LONGEST_UNIT = 1000, 100, 40
#: Characters of a map of channels. Chosen; no table.
LONGEST_MAP = 4096


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Bounds on one file and on the process that reads it."""

    #: Bytes, unpacked. Chosen; by docs/appendix/benchmarks.md five channels at 10 kHz for 1,400 s are half of it as CSV.
    most_bytes: int = 1 << 30
    #: Unpacked over packed bytes, and the unpacked bytes that are free of that rule: a short text of few digits packs well.
    #: Chosen; no table.
    most_ratio: int = 100
    free_bytes: int = 8 << 20
    #: Values that are taken, rows times channels. Chosen; 160 MB of memory as float64.
    most_values: int = 20_000_000
    #: Columns, whether they are taken or not. Chosen; no table.
    most_columns: int = 1000
    #: Seconds of a processor for one file. Chosen; by docs/appendix/benchmarks.md 1.4 million rows take 2.5 s at most, with
    #: fits and storage.
    seconds: int = 30
    #: Seconds by the clock, past which the machine is taken for too busy. Chosen: four times as many.
    wall_seconds: int = 120
    #: Address space of the process that reads a TDMS, MDF4 or Parquet file, bytes: 1.5 GiB. Chosen; no table.
    memory_bytes: int = 3 << 29

    def require_columns(self, number: int) -> None:
        """Raise InvalidError where a file has too many columns."""
        if number > self.most_columns:
            raise InvalidError(f"a file must not have more than {self.most_columns} columns, got {number}")


LIMITS = Limits()
