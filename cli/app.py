"""The command ``mcsettle``: its verbs, a module each, that parse options, call the package and print.

Everything heavy is imported inside the command that needs it, so that ``--help`` stays quick.
Options steer a run (sample size, seed, threads, batch, folders) and never the physics.
"""

import typer

from mcsettle.cli.calibrate import calibrate
from mcsettle.cli.check import check
from mcsettle.cli.doctor import doctor
from mcsettle.cli.grounds import grounds
from mcsettle.cli.init import init, schema
from mcsettle.cli.life import life
from mcsettle.cli.plan import plan
from mcsettle.cli.profile import profile
from mcsettle.cli.report import compare, export, report
from mcsettle.cli.run import run
from mcsettle.cli.status import gather, status
from mcsettle.cli.summarise import summarise
from mcsettle.cli.terminal import heed_termination, prepare_streams
from mcsettle.cli.tornado import tornado
from mcsettle.cli.track import track
from mcsettle.cli.validate import validate

app = typer.Typer(
    name="mcsettle",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Track settlement under traffic: tamping intervals and marginal tamping costs. "
    "Exit codes: 0 done, 1 a check or a computation failed, 2 bad input, 3 some realisations "
    "failed, 5 precision target missed, 130 interrupted.",
)
for verb in (
    *(init, check, schema, run, plan, status, gather, summarise, report, export, compare),
    *(calibrate, tornado, life, grounds, track, profile, validate, doctor),
):
    app.command()(verb)


def main() -> None:
    """Entry point of the ``mcsettle`` command."""
    prepare_streams()
    heed_termination()
    app()
