"""The command `clutchlife`: every command, in the order in which `--help` lists them."""

from collections.abc import Callable
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from service.cli import (
    alarms,
    answers,
    clutches,
    database,
    diagnose,
    export,
    fleet,
    importing,
    inspections,
    key,
    mcp,
    report,
    runs,
    simulate,
)
from service.cli.demo import demo
from service.cli.options import EX_USAGE, fail
from service.cli.sending import push
from service.cli.serving import serve


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version  # start-up time

        typer.echo(f"clutchlife {version('clutchlife')}")
        raise typer.Exit


#: What typer raises where a command is called wrongly.
_UsageError: Any = typer.BadParameter.__mro__[1]


class Commands(TyperGroup):
    """The group of all commands; a usage error prints one line, and after `status` ends with its code for an unknown
    state."""

    def invoke(self, ctx: Any) -> Any:
        """Run a command; a usage error ends it with one line and the right exit code."""
        try:
            return super().invoke(ctx)
        except _UsageError as error:
            if type(error).__name__ == "NoArgsIsHelpError":
                raise  # the help of a command that was called without anything
            failed = getattr(error, "ctx", None) or ctx
            text = f"{error.format_message().rstrip('.')}: see {failed.command_path} --help"
            # `clutchlife status` ends with the codes of monitoring plug-ins, of which UNKNOWN is one
            fail(text, clutches.UNKNOWN if ctx.invoked_subcommand == "status" else EX_USAGE)


app = typer.Typer(
    name="clutchlife",
    cls=Commands,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.callback()
def main(
    show_version: Annotated[
        bool, typer.Option("--version", help="Print the version and end", callback=_version, is_eager=True)
    ] = False,
) -> None:
    """Condition monitoring and prognostics of wet friction clutches."""


_COMMANDS: tuple[Callable[..., None], ...] = (
    serve.serve, demo.demo, simulate.simulate, push.push, importing.import_file, clutches.register,
    clutches.list_clutches, clutches.status, clutches.watch, alarms.alarms, answers.life, answers.degradation,
    answers.loops, answers.engagement, inspections.inspect, inspections.inspections, diagnose.diagnose,
    clutches.model, runs.runs, runs.withdraw, database.restore, runs.end, runs.confirm, runs.correct, clutches.edit,
    clutches.archive, runs.changes, export.export, report.report, mcp.mcp, fleet.score, database.replay, database.backup,
    database.verify, database.migrate,
)  # fmt: skip
#: Names that Python or typer has for something else.
_OTHER_NAMES: dict[Callable[..., None], str] = {importing.import_file: "import", clutches.list_clutches: "list"}
for _command in _COMMANDS:
    app.command(_OTHER_NAMES.get(_command))(_command)
app.add_typer(push.app, name="spool")
app.add_typer(key.app, name="key")
app.add_typer(database.app, name="raw")
app.add_typer(fleet.app, name="fleet")


if __name__ == "__main__":
    app()
