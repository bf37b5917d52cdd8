"""Names in the pages' JavaScript are nouns for what they hold, not pronouns; and pages use the words of the field."""

import re
from collections.abc import Iterator

import pytest

from service.dashboard import assets

PRONOUNS = (
    "each", "found", "told", "standing", "views", "said", "one", "these", "them", "those", "that", "some", "what", "seen",
    "asked", "known",
)  # fmt: skip
#: Words that an engineer would have to read twice, anywhere in the files.
QUAINT = (
    "foret",
    "reckon",
    "stranger",
    "spoiled",
    "swallow",
    "rebuilt cof",
    "told apart",
    "misses by",
    "worked out",
    "anew",
)
TEXTS = {name: asset.body.decode() for name, asset in assets.load().by_name.items() if not name.startswith("plotly")}
MODULES = {name: text for name, text in TEXTS.items() if name.endswith(".js")}

#: Comments, strings, regular expressions, and what else opens or closes a part of the text.
_TOKEN = re.compile(
    r"""//[^\n]*|/\*.*?\*/|"(?:[^"\\\n]|\\.)*"|'(?:[^'\\\n]|\\.)*'"""
    r"""|(?:(?<=[(,=:\[!&|?;])|(?<=\breturn))\s*/(?:[^/\\\n\[]|\\.|\[[^\]]*\])+/[a-z]*|[`{}]""",
    re.DOTALL,
)
_TEMPLATE = re.compile(r"(?:[^`\\$]|\\.|\$(?!\{))*(?:`|\$\{)", re.DOTALL)


def code(text: str) -> Iterator[str]:
    """The parts of a module that are neither comments nor texts; of a template its expressions alone."""
    at, depth = 0, list[str]()
    while token := _TOKEN.search(text, at):
        yield text[at : token.start()]
        at = token.end()
        template = token.group() == "`"
        if token.group() == "{":
            depth.append("{")
        elif token.group() == "}":
            template = depth.pop() == "${"
        if template:
            part = _TEMPLATE.match(text, at)
            assert part is not None
            at = part.end()
            if part.group().endswith("${"):
                depth.append("${")
    assert depth == []
    yield text[at:]


def names(text: str) -> set[str]:
    """Every name in a module's code but that of an array's method."""
    return {name for part in code(text) for name in re.findall(r"[A-Za-z_$][\w$]*", part.replace(".some(", "("))}


def test_names_are_read_and_texts_are_not() -> None:
    text = 'const a = "b c"; // d\nf(/g"h/, `i ${j(`k ${l}`, {m: 1})} n`); /* o */ p["q"]?.r'
    assert names(text) == {"const", "a", "f", "j", "l", "m", "p", "r"}


@pytest.mark.parametrize("name", sorted(MODULES))
def test_no_name_is_a_pronoun(name: str) -> None:
    assert names(MODULES[name]) & set(PRONOUNS) == set()


@pytest.mark.parametrize("name", sorted(TEXTS))
def test_the_words_are_those_of_the_field(name: str) -> None:
    assert [word for word in QUAINT if word in TEXTS[name].lower()] == []
