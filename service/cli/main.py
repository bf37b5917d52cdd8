"""The command `clutchlife`: every command, in the order in which `--help` lists them."""

import typer

from service.cli import diagnose, export, fleet, importing, inspections, key, model, score, simulate
from service.cli.answers import degradation, engagement, life, loops
from service.cli.changes import clutch_changes, run_changes, trail
from service.cli.changes import runs as run_list
from service.cli.database import backup, migrate, raw, replay, restore, verify
from service.cli.demo import demo
from service.cli.sending import push, spool_commands
from service.cli.serving import serve

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
app.command("import")(importing.import_file)
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
