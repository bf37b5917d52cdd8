"""The command `clutchlife`: every command, in the order in which `--help` lists them."""

import typer

from service.cli import backup, diagnose, export, fleet, key, model, replay, score, serve, simulate
from service.cli.demo import demo
from service.cli.sending import push, spool_commands

app = typer.Typer(
    name="clutchlife",
    help="Condition monitoring and prognostics of wet friction clutches.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command()(serve.serve)
app.command()(demo.demo)
app.command()(simulate.simulate)
app.command()(push.push)
app.command()(diagnose.diagnose)
app.command()(model.model)
app.command()(export.export)
app.command()(score.score)
app.command()(replay.replay)
app.command()(backup.backup)
app.add_typer(spool_commands.app, name="spool")
app.add_typer(key.app, name="key")
app.add_typer(fleet.app, name="fleet")


if __name__ == "__main__":
    app()
