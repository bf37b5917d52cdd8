"""What a column's name means: its quantity, and whether all of its words are known (`names.toml`).

Words of other languages (`other_names.toml`) and names that are known in part only propose what a column may be.
"""

import re
import tomllib
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from enum import Enum
from functools import lru_cache
from pathlib import Path

from service.channels import CHANNELS
from service.readers.limits import LONGEST_NAME
from service.readers.unit_table import conversion

#: Section -> kind of words -> words.
_Words = Mapping[str, Mapping[str, Sequence[str]]]
_TABLES: list[_Words] = [
    tomllib.loads(Path(__file__).with_name(name).read_text(encoding="utf-8"))
    for name in ("names.toml", "other_names.toml")
]
_NAMES = _TABLES[0]
_QUANTITY_NAMES = [name for name in _NAMES if name not in ("words", "run")]


def _of(section: str, kind: str, tables: Sequence[_Words] = _TABLES) -> list[str]:
    """The words of a kind, from both tables."""
    return [word for table in tables for word in table.get(section, {}).get(kind, ())]


def _every(table: _Words) -> set[str]:
    return {word.strip("-") for section in table.values() for words in section.values() for word in words}


_QUANTITIES = {word.strip("-"): name for name in _QUANTITY_NAMES for word in _of(name, "nouns")}
_ENDS = [word.strip("-") for name in _QUANTITY_NAMES for word in _of(name, "nouns") if word.startswith("-")]
#: Letters that stand for a quantity beside another word or a unit, which decides between several.
SYMBOLS = {
    letter: tuple(name for name in _QUANTITY_NAMES if letter in _of(name, "symbols"))
    for letter in sorted({letter for name in _QUANTITY_NAMES for letter in _of(name, "symbols")})
}
_LETTERS = {letter: name for name in _QUANTITY_NAMES for letter in _of(name, "letters")}
_TITLES = {name: name for name in CHANNELS} | {title: name for name in _QUANTITY_NAMES for title in _of(name, "titles")}
_SHORT = {name: frozenset(_of(name, "short")) for name in _QUANTITY_NAMES}
#: Words at a name that say that its values are means.
MEANS = {*_of("words", "means")}
#: Words at a speed that say that it is that between both sides of the clutch.
SLIDING = {*_of("words", "sliding")}
_NEUTRAL = {name: MEANS.union(_of("words", "any"), _of(name, "beside")) for name in _QUANTITY_NAMES}
_OIL, _PLATE, _REAR, _FRONT = ({*_of("words", kind)} for kind in ("oil", "plate", "rear", "front"))
_SPREAD = {*_of("words", "spread")}
_OTHER = re.compile("|".join(_of("words", "other")))
#: Words that no table but that of other languages has.
_FOREIGN = _every(_TABLES[1]) - _every(_NAMES)
#: Names of a time that are its unit, as historians title a column (`SECONDS`).
UNITS_AS_TITLES = {*_of("time_s", "titles")} - {"x_value"}
#: What makes a name that of another quantity: a sign, a power, a half.
_COMPUTED = re.compile(r"^[-−][^\W\d]|\^ ?[2-9]|[²³√]|/ ?[2-9](?![\d^.,/])")
#: Letters of a noun that may begin a word that it names (`pressact`), more than these. Chosen: `par` begins many words.
_LEAST_BEGINNING = 4
#: Words that are a speed only beside one of what turns.
_FREQUENCY = re.compile("fr[eé]qu?[eu]|frecu|частота")


class Sense(Enum):
    """How well a name is understood: entirely; entirely, in another language; in part; as another thing (a set point, a
    limit); not."""

    WHOLE, FOREIGN, PART, OTHER, UNKNOWN = range(5)


def key(name: str) -> str:
    """A name in a form for comparison, without differences in case, blanks, dashes, width, or ö and oe.

    Composing letters takes time with the square of the length where accents are piled up: only short names are composed.
    """
    plain = (unicodedata.normalize("NFKC", name) if len(name) <= LONGEST_NAME else name).strip().casefold()
    plain = plain.replace("oel", "öl").replace("θ", "theta").replace("ϑ", "theta").replace("ω", "omega")
    return re.sub(r"[\s._\-]+", "_", plain).strip("_")


@lru_cache(maxsize=4096)
def meaning(name: str, unit: str | None = None) -> tuple[str | None, Sense]:
    """The channel that a name and its unit stand for, and how well they are understood.

    One quantity's noun, or without any its symbol, names the channel; the other words leave it that of the clutch, make it
    another thing, or are not known. What follows a backslash names a device (`torque\\CAN:1`); numbers and few letters
    before them are labels (`CH1-1`). A symbol, and a name that is understood in part, must have a unit that fits.
    """
    bare = name.partition("\\")[0].strip()
    known_as = key(bare) if len(bare) <= LONGEST_NAME else ""
    if known := _LETTERS.get(bare) or _TITLES.get(known_as):
        return known, Sense.WHOLE
    name_words = words(bare) if known_as else []
    if _COMPUTED.search(bare):
        return None, Sense.OTHER
    parts = [(word, next((end for end in _ENDS if word.endswith(end)), word)) for word in name_words]
    parts = [(word, word if word in _QUANTITIES else noun) for word, noun in parts]
    quantities = {_QUANTITIES[noun] for _, noun in parts if noun in _QUANTITIES}
    unknown_words = {word.removesuffix(noun) if noun in _QUANTITIES else word for word, noun in parts} - {""}
    by_noun = bool(quantities)
    if not by_noun:
        symbol = next((word for word in name_words if word in SYMBOLS), "")
        quantities = {q for q in SYMBOLS.get(symbol, ()) if (len(name_words) > 1 and unit is None) or measures(q, unit)}
        if len(quantities) > 1:
            hot = bool(unknown_words & (_OIL | _PLATE))
            quantities = {quantity for quantity in quantities if (quantity == "temperature") == hot}
    if len(quantities) != 1:
        return None, Sense.UNKNOWN
    (quantity,) = quantities
    foreign = bool((unknown_words | {noun for _, noun in parts}) & _FOREIGN)
    unknown_words -= {word for word, of in SYMBOLS.items() if quantity in of} | _NEUTRAL[quantity]
    channel = quantity
    if quantity == "temperature":
        of = unknown_words | set(name_words)
        channel = "oil_temperature_c" if of & _OIL else "plate_temperature_" + ("rear_c" if of & _REAR else "front_c")
        if not of & (_OIL | _PLATE):
            return None, Sense.UNKNOWN
        unknown_words -= _OIL | _PLATE | _REAR | _FRONT
    elif quantity == "torque_nm" and unknown_words & _SPREAD:
        channel, unknown_words = "torque_sd_nm", unknown_words - _SPREAD
    if any(map(_OTHER.match, unknown_words)):
        return None, Sense.OTHER
    if any(_FREQUENCY.search(noun) for _, noun in parts) and (
        unknown_words or len(name_words) == 1 == len(set(parts[0]))
    ):
        return None, Sense.UNKNOWN
    if not unknown_words and (by_noun or unit is None or measures(quantity, unit)):
        return channel, Sense.FOREIGN if foreign else Sense.WHOLE
    return (channel, Sense.PART) if measures(quantity, unit) else (None, Sense.UNKNOWN)


def words(name: str, *, digits: bool = False) -> list[str]:
    """The words of a name in lower case, without labels that end in a number; or with them (`digits`)."""
    known_as = key(re.sub(r"(?<=[a-zäöüß])(?=[A-Z])", " ", name))
    if digits:
        return re.findall(r"[^\W_]+", known_as)
    known_as = re.sub(r"(?<![^\W_])(?:ch|ai|cnt|kanal|max_?|[a-z])?\d+(?![^\W_])", " ", known_as)
    return re.findall(r"[^\W\d_]+", known_as)


def has_noun(quantity: str, name: str) -> bool:
    """Whether a word of a name, its end or its beginning names a quantity."""
    nouns = {noun for noun, of in _QUANTITIES.items() if of == quantity}
    ends = tuple(end for end in _ENDS if end in nouns)
    beginnings = tuple(noun for noun in nouns if len(noun) > _LEAST_BEGINNING)
    own = words(name[:LONGEST_NAME])
    return any(word in nouns or word.endswith(ends) or word.startswith(beginnings) for word in own)


def is_short_for(channel: str, name: str) -> bool:
    """Whether a name is, or begins with, a usual short name of a channel (`Mz`, `n1`, `p_2`)."""
    first = next(iter(re.findall(r"[^\W\d_]+", key(name[:LONGEST_NAME]))), "")
    return first in _SHORT.get(channel, ())


def label_of(what: str, stated: Iterable[str]) -> str | None:
    """The label above a table that has the run's `cycles` or its `clutch` beside it; None if there is none."""
    wanted = {key(label) for label in _of("run", what)}
    return next((label for label in stated if key(label.rstrip(":=. ")) in wanted), None)


def of_time(word: str) -> bool:
    """Whether a word names a time."""
    return word == "t" or _QUANTITIES.get(word) == "time_s"


def measures(quantity: str, unit: str | None) -> bool:
    """Whether a unit is one of a quantity's."""
    return unit is not None and conversion(quantity if quantity in CHANNELS else "oil_temperature_c", unit) is not None


def known_channel(name: str) -> str | None:
    """The public channel that a name stands for in any language, whatever its unit, else None."""
    channel, sense = meaning(name)
    return channel if sense in (Sense.WHOLE, Sense.FOREIGN) else None


def is_another(name: str) -> bool:
    """Whether a word of a name says that it is another quantity than one measured at the clutch."""
    return any(map(_OTHER.match, words(name[:LONGEST_NAME])))
