"""The tables of docs/appendix/diagnosis.md, made from the catalogue's values: `python -m tests.models.diagnosis.tables`.

Writes them into the document, between their marks.
"""

from models.diagnosis.effects.catalogue import CATALOGUE
from models.diagnosis.effects.effect import EffectKind
from models.diagnosis.experiments.candidates import TRIALS
from tests.lab.measuring import APPENDIX, fill, table

#: What an adopted effect does, by its kind.
ADOPTED = {
    EffectKind.ARTEFACT: "artefact: taken off each measurement",
    EffectKind.COURSE: "course: followed along the life",
    EffectKind.LAG: "loops only: shown, nothing to adopt for a life",
    EffectKind.VIBRATION: "raw records only: shown, nothing to adopt for a life",
}


def catalogue_table() -> str:
    """An effect a row."""
    titles = ("effect", "physics", "change of torque", "source", "channels beside speed, pressure, torque", "kind")
    rows = []
    for effect in CATALOGUE:
        channels = ", ".join(f"`{name}`" for name in effect.channels) or "none"
        rows.append((f"`{effect.slug}`", effect.physics, effect.formula, effect.source, channels, ADOPTED[effect.kind]))
    return "\n".join(table(titles, rows))


def trials_table() -> str:
    """A trial a row."""
    return "\n".join(table(("key", "test"), ((f"`{key}`", trial.text) for key, trial in TRIALS.items() if trial.text)))


#: By the names of their parts in the document.
TABLES = {"catalogue": catalogue_table, "trials": trials_table}

if __name__ == "__main__":
    fill(APPENDIX / "diagnosis.md", {name: make() for name, make in TABLES.items()})
