"""The command ``mcsettle``: its verbs, a module each, that parse options, call the package and print.

Everything heavy is imported inside the command that needs it, so that ``--help`` stays quick.
Options steer a run (sample size, seed, threads, batch, folders) and never the physics.
"""

from typing import Annotated

import typer
from rich.markup import escape

from mcsettle.cli.calibrate import calibrate
from mcsettle.cli.check import check
from mcsettle.cli.doctor import doctor
from mcsettle.cli.examples import EXAMPLES
from mcsettle.cli.grounds import grounds
from mcsettle.cli.init import init, schema
from mcsettle.cli.life import life
from mcsettle.cli.plan import plan
from mcsettle.cli.profile import profile
from mcsettle.cli.report import compare, export, report
from mcsettle.cli.run import run
from mcsettle.cli.sections import sections
from mcsettle.cli.status import gather, status
from mcsettle.cli.summarise import summarise
from mcsettle.cli.terminal import EXIT_CODES, heed_termination, prepare_streams
from mcsettle.cli.tornado import tornado
from mcsettle.cli.track import track
from mcsettle.cli.validate import validate

CODES = "; ".join(f"{code} {meaning}" for code, meaning in EXIT_CODES.items())
app = typer.Typer(
    name="mcsettle",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Track settlement under traffic: tamping intervals and marginal tamping costs. "
    f"Exit codes: {CODES}.",
)


def print_version(asked: bool) -> None:
    """Print the version and end."""
    if asked:
        from mcsettle import __version__

        typer.echo(f"mcsettle {__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=print_version, is_eager=True, help="Print it.")
    ] = False,
) -> None:
    """Options of the command itself."""


for verb in (
    *(init, check, schema, run, plan, status, gather, summarise, report, export, compare),
    *(calibrate, tornado, life, sections, grounds, track, profile, validate, doctor),
):
    app.command(epilog=f"Example: {escape(EXAMPLES[verb.__name__])}")(verb)


def main() -> None:
    """Entry point of the ``mcsettle`` command."""
    prepare_streams()
    heed_termination()
    app()
