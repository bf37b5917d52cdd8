"""The pages of docs/reference that are made from the code: settings, commands, routes, fields, codes, metrics.

Each is a function from the code to Markdown. Routes, fields, commands and codes are made for the site alone (`made`) and
stand in no repository. Tables of docs/appendix that other pages quote are copied to them again. `python -m tests.documents`
writes all, `test_reference.py` holds them. Nothing here needs more than what the service runs with.
"""

import ast
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import click
import typer
from prometheus_client.parser import text_string_to_metric_families

from service import errors
from service.app import create_app
from service.cli import main as command_line
from service.settings import PREFIX, Settings
from service.web.metrics import Metrics
from storage.engine.opening import open_database
from tests.lab import measuring
from tests.lab.measuring import ROOT

FOLDER = ROOT / "docs" / "reference"
OUT_OF_GIT = ("codes.md", "commands.md", "fields.md", "routes.md")
#: Statuses that every address with a key may answer with.
ANYWHERE = (401, 403, 422, 429, 503)
#: Arguments that need no help in the terminal.
PLAIN = {"clutch": "The clutch's name", "run": "The run's name", "key_id": "The key's id, as `key list` shows it"}
PLAIN |= {"path": "The file to write", "port": "The port to listen at"}
#: Options of all commands that ask a service, described once.
ASKING = ("--url", "--key", "--patience")
WRITTEN = "This page is made from the code by `make reference`."
Json = Mapping[str, Any]


def made() -> dict[Path, str]:
    """The pages that are out of git."""
    description = create_app(Settings()).openapi()
    by_name = {
        "commands": commands(),
        "routes": routes(description),
        "fields": fields(description),
        "codes": codes(),
    }
    return {FOLDER / f"{name}.md": text for name, text in by_name.items()}


def kept() -> dict[Path, str]:
    """The pages that are in git: short ones, and those that quote a table of another."""
    own = {FOLDER / "settings.md": settings(), FOLDER / "metrics.md": metrics()}
    others = [
        path
        for path in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
        if path not in own and path.name not in OUT_OF_GIT
    ]
    return own | {path: quoting(path) for path in others if "<!-- quote " in path.read_text(encoding="utf-8")}


def pages() -> dict[Path, str]:
    """All of them."""
    return made() | kept()


_QUOTE = re.compile(r"(<!-- quote (\S+): (.*?) -->\n)(.*?)(<!-- end -->)", flags=re.DOTALL)


def quoting(path: Path) -> str:
    """A page whose quoted tables are those of the page that they come from, with the command above them."""

    def filled(match: re.Match[str]) -> str:
        rows = (ROOT / "docs" / match[2]).read_text(encoding="utf-8").splitlines()
        return f"{match[1]}{quoted(rows, match[3].split('; '))}\n{match[5]}"

    return _QUOTE.sub(filled, path.read_text(encoding="utf-8"))


def quoted(lines: Sequence[str], keys: Sequence[str]) -> str:
    """The rows that begin with these cells, of the first table that has all of them. Raises ValueError."""
    for start in (number for number, line in enumerate(lines) if line.startswith(("|---", "| ---"))):
        end = next((n for n in range(start, len(lines)) if not lines[n].startswith("|")), len(lines))
        by_key = {line.split(" | ")[0].removeprefix("| "): line for line in reversed(lines[start + 1 : end])}
        if all(key in by_key for key in keys):
            command = next(line for line in reversed(lines[:start]) if line.startswith("`make "))
            return "\n".join([command, "", *lines[start - 1 : start + 1], *(by_key[key] for key in keys)])
    raise ValueError(f"no table has all of {keys}")


def write(pages: Mapping[Path, str]) -> None:
    for path, text in pages.items():
        path.write_text(text, encoding="utf-8")
        print(f"{path.relative_to(ROOT)}: {len(text.splitlines())} lines")


def page(title: str, introduction: str, parts: Iterable[str]) -> str:
    return "\n\n".join([f"# {title}", f"{introduction} {WRITTEN}", *parts]) + "\n"


def table(titles: str, rows: Iterable[Sequence[str]]) -> str:
    """A table of Markdown, `titles` with bars between them; bars and line breaks in cells are escaped."""
    cells = [[_text(" ".join(cell.split()).replace("\\|", "|")) for cell in row] for row in rows]
    return "\n".join(measuring.table(titles.split(" | "), cells))


def settings() -> str:
    rows = []
    for name, field in Settings.model_fields.items():
        shown = str(field.default).lower() if isinstance(field.default, bool | None) else str(field.default)
        rows.append([f"`{PREFIX}{name.upper()}`", f"`{shown or 'none'}`", field.description or ""])
    parts = [
        "## The service",
        "A wrong value ends the start with a line that names it. A misspelt name causes a warning.",
        table("environment | default | meaning", rows),
        "## The commands",
        "Commands that talk to a service read two more.",
        table("environment | meaning", [[f"`{name}`", text] for name, text in sorted(_command_variables().items())]),
    ]
    return page("Settings", "Settings come from the environment.", parts)


def _command_variables() -> dict[str, str]:
    found: dict[str, str] = {}
    for _, command in walk():
        for option in command.params:
            if option.envvar:
                found.setdefault(option.envvar, option.help)
    return {
        name: text for name, text in found.items() if name.removeprefix(PREFIX).lower() not in Settings.model_fields
    }


def walk() -> Iterator[tuple[str, click.Command]]:
    """Every command by its whole name, in the order of `--help`."""

    def below(name: str, command: click.Command) -> Iterator[tuple[str, click.Command]]:
        children: dict[str, click.Command] = getattr(command, "commands", {})
        if not children or getattr(command, "invoke_without_command", False):
            yield name, command
        for child, found in children.items():
            yield from below(f"{name} {child}", found)

    for name, command in typer.main.get_command(command_line.app).commands.items():
        yield from below(f"clutchlife {name}", command)


def commands() -> str:
    parts = []
    for name, command in walk():
        rows = [
            [", ".join(f"`{each}`" for each in _names(option)), _meaning(option)]
            for option in command.params
            if not getattr(option, "hidden", False) and not set(_names(option)) & set(ASKING)
        ]
        text = re.sub(r"\n\n\s*", "\n\n", (command.help or "").strip())
        parts += [f"## {name}", text, table("argument or option | meaning", rows)] if rows else [f"## {name}", text]
    introduction = "`clutchlife COMMAND --help` says the same. [Exit codes](operations.md#exit-codes)."
    every = {name: _meaning(option) for _, command in walk() for option in command.params for name in _names(option)}
    shared = table("option | meaning", [[f"`{name}`", every[name]] for name in ASKING])
    return page("Commands", introduction, ["Commands that ask a service have three more options:", shared, *parts])


def _meaning(option: click.Parameter) -> str:
    return getattr(option, "help", None) or PLAIN.get(option.name or "", "")


def _names(option: click.Parameter) -> list[str]:
    if option.param_type_name == "argument":
        return [(option.name or "").upper()]
    return [*option.opts, *option.secondary_opts]


def routes(description: Json) -> str:
    """Every address with its arguments, body and answers, by the description's tags."""
    by_tag: dict[str, list[str]] = {}
    for address, methods in description["paths"].items():
        for method, route in methods.items():
            tag = (route.get("tags") or ["service"])[0]
            by_tag.setdefault(tag, []).append(_route(method.upper(), address, route))
    parts = [part for tag, found in by_tag.items() for part in (f"## {tag[0].upper()}{tag[1:]}", *found)]
    introduction = (
        "The addresses of the service; [the API by example](api.md) shows their use, and `/docs` of a running service lets "
        "you try them. Types with a capital letter are in [Fields](fields.md). Every address below `/v1` may also answer "
        "401, 403, 422, 429 and 503 ([Errors](codes.md))."
    )
    return page("Routes", introduction, parts)


def _route(method: str, address: str, route: Json) -> str:
    parts = [f"### {method} {address}".replace("{", "\\{").replace("}", "\\}"), _text(route.get("description", ""))]
    arguments = [
        [f"`{each['name']}`", each["in"], kind(each["schema"]), each.get("description", "")]
        for each in route.get("parameters", [])
    ]
    if arguments:
        parts.append(table("argument | in | type | meaning", arguments))
    body = route.get("requestBody", {}).get("content", {})
    if body:
        parts.append("Body: " + ", ".join(f"`{media}` {_kind_of(each)}" for media, each in body.items()))
    answers = [
        [status, each.get("description", ""), ", ".join(sorted(set(map(_kind_of, each.get("content", {}).values()))))]
        for status, each in route["responses"].items()
        if int(status) not in ANYWHERE
    ]
    parts.append(table("status | when | content", answers))
    return "\n\n".join(part for part in parts if part)


def _kind_of(content: Json) -> str:
    return kind(content.get("schema", {}))


def kind(schema: Json) -> str:
    """A schema's type in a few words, a link where it has a name."""
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        return f"[{name}](fields.md#{name.lower()})"
    for joint in ("anyOf", "oneOf"):
        if joint in schema:
            return " or ".join(dict.fromkeys(kind(each) for each in schema[joint]))
    if "enum" in schema:
        return ", ".join(f"`{value}`" for value in schema["enum"])
    if "const" in schema:
        return f"`{schema['const']}`"
    if schema.get("type") == "array":
        return f"list of {kind(schema.get('items', {}))}"
    if isinstance(schema.get("additionalProperties"), Mapping):
        return f"object of {kind(schema['additionalProperties'])}"
    return str(schema.get("type", "any"))


def fields(description: Json) -> str:
    parts = []
    for name, schema in sorted(description["components"]["schemas"].items()):
        parts += [f"## {name}", _text(schema.get("description", ""))]
        required = set(schema.get("required", ()))
        rows = [
            [f"`{field}`{'' if field in required else ' (optional)'}", kind(each), each.get("description", "")]
            for field, each in schema.get("properties", {}).items()
        ]
        parts.append(table("field | type | meaning", rows) if rows else f"One of {kind(schema)}.")
    return page("Fields", "What goes over the wire. A unit is in the name of its field.", parts)


def _text(docstring: str) -> str:
    return re.sub(r"<(?=[a-zA-Z/])", "&lt;", docstring.strip())


def codes() -> str:
    """Problems by their type, and the codes of errors and warnings with what they say."""
    problems = [
        [f"`urn:clutchlife:problem:{each.slug}`", str(each.status), each.title, (each.__doc__ or "").strip()]
        for each in sorted(_kinds(errors.ServiceError), key=lambda each: (each.status, each.slug))
    ]
    said: dict[str, dict[str, str]] = {"FieldError": {}, "Notice": {}}
    for name, code, message in messages():
        said[name].setdefault(code, message if re.search(r"\w", message) else "its message says what is wrong")
    parts = [
        "## Problems",
        "The `type` of `application/problem+json`, the status, and when.",
        table("type | status | title | when", problems),
        "## Errors of a place",
        "The `code` of an entry of `errors`; `…` stands for the value. Codes of pydantic (`missing`, `extra_forbidden`, "
        "`greater_than_equal` and the like) say that a field is not there, not known or out of its range.",
        table("code | message", [[f"`{code}`", message] for code, message in sorted(said["FieldError"].items())]),
        "## Warnings and doubts",
        "The `code` of an entry of `warnings` or `doubts`: something was noticed, and the run was taken in.",
        table("code | message", [[f"`{code}`", message] for code, message in sorted(said["Notice"].items())]),
    ]
    return page("Errors and warnings", "What the service may object to or notice.", parts)


def _kinds(base: type[errors.ServiceError]) -> list[type[errors.ServiceError]]:
    return [base, *(found for child in base.__subclasses__() for found in _kinds(child))]


def messages() -> Iterator[tuple[str, str, str]]:
    """(FieldError or Notice, code, message) wherever the code makes one with a code that stands there; notes of the
    numerics, pairs of a code and a sentence, are notices too."""
    paths = [path for folder in ("service", "models") for path in sorted((ROOT / folder).rglob("*.py"))]
    trees = [ast.parse(path.read_text(encoding="utf-8")) for path in paths]
    constants = dict(pair for tree in trees for pair in _constants(tree))
    for tree in trees:
        for function in ast.walk(tree):
            if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef):
                yield from _of_function(function, constants)
        yield from _of_function(tree, constants)  # what stands outside of functions; of the others the first stands


def _constants(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """Names of a module, or of its enumerations, that stand for a text."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign) and len(node.targets) == 1:
            target, value = node.targets[0], node.value
            together = isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple)
            for name, text in zip(target.elts, value.elts, strict=False) if together else [(target, value)]:
                if isinstance(name, ast.Name) and isinstance(text, ast.Constant) and isinstance(text.value, str):
                    yield name.id, text.value


def _of_function(function: ast.AST, constants: Mapping[str, str]) -> Iterator[tuple[str, str, str]]:
    assigned = [node for node in ast.walk(function) if isinstance(node, ast.Assign)]
    for node in ast.walk(function):
        made = ast.unparse(node.func) if isinstance(node, ast.Call) else ""
        if isinstance(node, ast.Call) and made in ("FieldError", "Notice", "InvalidError.of"):
            given = {each.arg: each.value for each in node.keywords}
            message = node.args[0] if made == "InvalidError.of" else given.get("message")
            for code in _codes(given.get("code"), constants):
                yield "Notice" if made == "Notice" else "FieldError", code, _said(message, assigned, node.lineno)
        elif isinstance(node, ast.Tuple) and len(node.elts) == 2:
            code, sentence = node.elts
            if isinstance(code, ast.Constant) and re.fullmatch(r"[a-z]+(_[a-z]+)+", str(code.value)):
                words = _said(sentence, assigned, node.lineno)
                if isinstance(sentence, ast.JoinedStr) or words.endswith("."):
                    yield "Notice", str(code.value), words


def _codes(node: ast.expr | None, constants: Mapping[str, str]) -> list[str]:
    match node:
        case ast.Constant(value=value):
            return [str(value)]
        case ast.Name(id=name) | ast.Attribute(attr=name) if name in constants:
            return [constants[name]]
        case ast.IfExp():
            return _codes(node.body, constants) + _codes(node.orelse, constants)
    return []


def _said(node: ast.expr | None, assigned: Sequence[ast.Assign], line: int) -> str:
    """The words of an expression; of a name those that it was last given above that line."""
    match node:
        case ast.Constant(value=value):
            return str(value)
        case ast.JoinedStr(values=values):
            return "".join(str(part.value) if isinstance(part, ast.Constant) else "…" for part in values)
        case ast.BinOp(left=left, right=right):
            return _said(left, assigned, line) + _said(right, assigned, line)
        case ast.Name(id=name):
            targets = ((each, target) for each in assigned if each.lineno < line for target in each.targets)
            before = [each for each, target in targets if isinstance(target, ast.Name) and target.id == name]
            return _said(max(before, key=lambda each: each.lineno).value, [], line) if before else "…"
    return "…"


def metrics() -> str:
    with (
        TemporaryDirectory() as folder,
        closing(open_database(f"sqlite:///{folder}/metrics.db", serving=False)) as database,
    ):
        text = Metrics(each_clutch=True).exposition(database).decode()
    rows = sorted(
        [f"`{family.name}{'_total' if family.type == 'counter' else ''}`", family.type, family.documentation]
        for family in text_string_to_metric_families(text)
    )
    introduction = (
        "`/metrics` in Prometheus' format, with a key of scope `read` that is bound to no clutch. Series "
        "`clutchlife_clutch_…` are there with `CLUTCHLIFE_CLUTCH_METRICS=true` only."
    )
    return page("Metrics", introduction, [table("series | type | meaning", rows)])
