"""The command `clutchlife`: every command, in the order in which `--help` lists them."""

from importlib.metadata import version
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from service.cli import alarms, clutches, diagnose, export, fleet, importing, inspections, key, model, score, simulate
from service.cli.answers import degradation, engagement, life, loops
from service.cli.changes import clutch_changes, run_changes, trail
from service.cli.changes import runs as run_list
from service.cli.database import backup, migrate, raw, replay, restore, verify
from service.cli.demo import demo
from service.cli.options import EX_USAGE, fail
from service.cli.sending import push, spool_commands
from service.cli.serving import serve


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"clutchlife {version('clutchlife')}")
        raise typer.Exit


#: What typer raises where a command is called wrongly.
_UsageError: Any = typer.BadParameter.__mro__[1]


class Commands(TyperGroup):
    """The commands; a wrong call ends in one line, `status` then with its code for what is unknown."""

    def invoke(self, ctx: Any) -> Any:
        """The command that was called."""
        try:
            return super().invoke(ctx)
        except _UsageError as error:
            if type(error).__name__ == "NoArgsIsHelpError":
                raise  # the help of a command that was called without anything
            place = getattr(error, "ctx", None) or ctx
            text = f"{error.format_message().rstrip('.')}: see {place.command_path} --help"
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


app.command()(serve.serve)
app.command()(demo.demo)
app.command()(simulate.simulate)
app.command()(push.push)
app.command("import")(importing.import_file)
app.command()(clutches.register)
app.command("list")(clutches.list_clutches)
app.command()(clutches.status)
app.command()(clutches.watch)
app.command()(alarms.alarms)
app.command()(life.life)
app.command()(degradation.degradation)
app.command()(loops.loops)
app.command()(engagement.engagement)
app.command()(inspections.inspect)
app.command()(inspections.inspections)
app.command()(diagnose.diagnose)
app.command()(model.model)
app.command()(run_list.runs)
app.command()(run_changes.withdraw)
app.command()(restore.restore)
app.command()(run_changes.end)
app.command()(run_changes.confirm)
app.command()(run_changes.correct)
app.command()(clutch_changes.edit)
app.command()(clutch_changes.archive)
app.command()(trail.changes)
app.command()(export.export)
app.command()(score.score)
app.command()(replay.replay)
app.command()(backup.backup)
app.command()(verify.verify)
app.command()(migrate.migrate)
app.add_typer(spool_commands.app, name="spool")
app.add_typer(key.app, name="key")
app.add_typer(raw.app, name="raw")
app.add_typer(fleet.app, name="fleet")


if __name__ == "__main__":
    app()
