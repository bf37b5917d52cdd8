"""Planned duty as a person writes it: blocks on the command line, or the forecast's request body in a file."""

import json
from pathlib import Path
from typing import Any

from service.cli.options import EX_USAGE, errors_in_a_line, fail

BLOCK = "CYCLES:KJ[:SD]"


def programme(plan: Path | None, blocks: list[str], pace: float | None) -> dict[str, Any]:
    """The request body; what is wrong with its content the service says. A pace that is given replaces the file's."""
    if plan is not None and blocks:
        fail("use --plan or --block, not both", EX_USAGE)
    body = {"programme": [_block(text) for text in blocks]} if plan is None else _read(plan)
    return body if pace is None else body | {"pace_cycles_per_hour": pace}


def _read(plan: Path) -> dict[str, Any]:
    with errors_in_a_line():
        body = json.loads(plan.read_bytes())
    if not isinstance(body, dict):
        fail(f'{plan} must hold an object, {{"programme": [...]}}', EX_USAGE)
    return body


def _block(text: str) -> dict[str, float]:
    names = ("cycles", "energy_per_cycle_kj", "sd")
    try:
        values = [float(part) for part in text.split(":")]
    except ValueError:
        values = []
    if not 2 <= len(values) <= len(names):
        fail(f"--block takes {BLOCK}, got {text!r}", EX_USAGE)
    return dict(zip(names, values, strict=False))
