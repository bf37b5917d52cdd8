"""What reading one file may cost."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Bounds on one file: bytes (unpacked), unpacking, values that are taken, columns, and its reader's seconds and memory.

    `most_ratio` holds past the first `free_bytes` unpacked: a short text of few digits packs well.
    """

    most_bytes: int = 1 << 30
    most_ratio: int = 100
    free_bytes: int = 8 << 20
    most_values: int = 20_000_000
    most_columns: int = 1000
    seconds: int = 30
    memory_bytes: int = 3 << 29


LIMITS = Limits()
