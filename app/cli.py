"""Command line: `spinscope COMMAND`; without a command it tunes the default sample."""

from __future__ import annotations

import sys

import click

from spinscope.pipeline.errors import SpinscopeError
from spinscope.pipeline.session import DEFAULT_SAMPLE, Choices

from .commands.analyze import analyze
from .commands.calibrate import calibrate
from .commands.cameras import cameras
from .commands.coach import coach
from .commands.convert import convert
from .commands.evaluate import evaluate
from .commands.info import info
from .commands.label import label
from .commands.live import live, watch
from .commands.options import CommandGroup, join_fixed_ball
from .commands.settings import settings
from .commands.simulate import simulate
from .commands.split import split
from .commands.tune import tune
from .commands.view import view
from .terminal import (
    FULL_DISK,
    announce_compilation,
    drop_output,
    exit_on_signals,
    ignore_signals_at_exit,
    note,
    prepare_streams,
    requested_status,
)


@click.group(
    cls=CommandGroup,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)
@click.version_option(package_name="spinscope", prog_name="spinscope")
@click.pass_context
def cli(context: click.Context) -> None:
    """See every stage of an event-camera spin estimator for table tennis, side by side on one timeline.

    Without a command: open a sample recording in a page with sliders beside the viewer.
    """
    if context.invoked_subcommand is None:
        from .web import serve

        note(f"opening the sample {DEFAULT_SAMPLE.name}; `spinscope --help` lists what else there is")
        serve(DEFAULT_SAMPLE, Choices())


COMMANDS = (
    tune, view, analyze, info, coach, live, watch, cameras, convert, split, simulate, evaluate, calibrate, label,
    settings,
)  # fmt: skip

for _command in COMMANDS:
    cli.add_command(_command)


def main() -> None:
    """Run the command line of this process."""
    prepare_streams()
    exit_on_signals()
    announce_compilation()
    try:
        status = run(sys.argv[1:])
    finally:
        ignore_signals_at_exit()
    sys.exit(status)


def run(arguments: list[str]) -> int:
    """Run a command and return its exit status; our errors and click's become one line on standard error and 2."""
    try:
        status = cli.main(join_fixed_ball(arguments), prog_name="spinscope", standalone_mode=False)
        sys.stdout.flush()
    except SpinscopeError as error:
        message = str(error)
    except click.Abort:
        return 130
    except click.ClickException as error:
        message = " ".join(error.format_message().split())
        context = getattr(error, "ctx", None)
        if context is not None:
            message += f" (`{context.command_path} --help` explains)"
    except BrokenPipeError:
        sys.stderr.close()
        return 0
    except OSError as error:
        if error.errno not in FULL_DISK:
            raise
        drop_output()
        message = f"the output cannot be written ({error.strerror}): check free space"
    except (KeyboardInterrupt, Exception) as error:
        requested = requested_status(error)
        if requested is None:
            raise
        return requested
    else:
        return status or 0
    note(f"spinscope: {message}")
    return 2
