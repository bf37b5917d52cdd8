"""The tables of docs/appendix/diagnosis.md, made from the catalogue's values: `python -m tests.models.diagnosis.tables`.

Writes them into the document, between their marks.
"""

import re
from pathlib import Path

from models.diagnosis.effects.catalogue import CATALOGUE
from models.diagnosis.effects.effect import Kind
from models.diagnosis.experiments.candidates import TRIALS

#: What an adopted effect does, by its kind.
ADOPTED = {
    Kind.ARTEFACT: "artefact: taken off each measurement",
    Kind.COURSE: "course: followed along the life",
    Kind.LAG: "loops only: shown, nothing to adopt for a life",
    Kind.VIBRATION: "raw records only: shown, nothing to adopt for a life",
}


def catalogue_table() -> str:
    """An effect a row."""
    rows = [("effect", "physics", "change of torque", "source", "channels beside speed, pressure, torque", "kind")]
    rows.append(("---",) * len(rows[0]))
    for effect in CATALOGUE:
        channels = ", ".join(f"`{name}`" for name in effect.channels) or "none"
        rows.append((f"`{effect.slug}`", effect.physics, effect.formula, effect.source, channels, ADOPTED[effect.kind]))
    return _table(rows)


def trials_table() -> str:
    """A trial a row."""
    rows = [("key", "test"), ("---", "---"), *((f"`{key}`", trial.text) for key, trial in TRIALS.items() if trial.text)]
    return _table(rows)


def _table(rows: list[tuple[str, ...]]) -> str:
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows)


def main() -> None:
    """Put both tables into the document."""
    document = Path(__file__).parents[3] / "docs" / "appendix" / "diagnosis.md"
    text = document.read_text(encoding="utf-8")
    for mark, table in (("catalogue", catalogue_table()), ("trials", trials_table())):
        start, end = f"<!-- {mark} -->", f"<!-- /{mark} -->"
        whole = f"{start}\n\n{table}\n\n{end}"
        text = re.sub(f"{start}.*?{end}", lambda _, whole=whole: whole, text, flags=re.DOTALL)
    document.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
