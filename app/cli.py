"""The command line: `spinscope COMMAND`; without a command it tunes the default sample."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from spinscope.pipeline.errors import ParameterError, SpinscopeError
from spinscope.pipeline.files import atomic_file, check_writable
from spinscope.pipeline.recordings import writable_suffixes
from spinscope.pipeline.registry import methods
from spinscope.pipeline.session import DEFAULT_SAMPLE, Choices, Session
from spinscope.pipeline.simulated_recordings import KINDS, SceneParameters

from .terminal import ProgressBar, announce_compilation, note, print_reports

LAYOUTS = ("all", "tracker", "logo", "spin", "coach")
RECORDING = click.Path(path_type=Path)


class SensorSize(click.ParamType[tuple[int, int]]):
    """WIDTHxHEIGHT in pixels."""

    name = "WxH"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, int]:
        width, _, height = str(value).lower().partition("x")
        if not (width.isdecimal() and height.isdecimal() and 1 <= int(width) <= 65536 and 1 <= int(height) <= 65536):
            self.fail(f"{value!r} is not a sensor size: write WIDTHxHEIGHT in pixels, like 1280x720", param, ctx)
        return int(width), int(height)


class FixedBall(click.ParamType[tuple[float, float, float] | str]):
    """`auto`, or three numbers (the command line's are joined by commas before click sees them)."""

    name = "X_PX Y_PX RADIUS_PX | auto"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, float, float] | str:
        if value == "auto":
            return "auto"
        try:
            x, y, radius = (float(number) for number in str(value).split(","))
        except ValueError:
            self.fail(f"{value!r} is neither `auto` nor three numbers X_PX Y_PX RADIUS_PX", param, ctx)
        return x, y, radius


def _choices(command: Callable[..., None]) -> Callable[..., None]:
    """The options that analyze and view share; the command gets them as one `choices`."""
    options = (
        click.option(
            "--preset",
            metavar="NAME|FILE.toml",
            help="Settings to start from: default, paper, or a TOML file.",
        ),
        click.option(
            "--set",
            "assignments",
            multiple=True,
            metavar="STAGE.FIELD=VALUE",
            help="Change one setting; repeatable, like --set logo.pad_px=3.",
        ),
        click.option(
            "--window",
            type=int,
            nargs=2,
            metavar="START_US END_US",
            help="Use only the events of [START, END), file time in us.",
        ),
        click.option(
            "--fixed-ball",
            type=FixedBall(),
            help="The ball stays in place (ball spinner): its circle, or auto to find it.",
        ),
        click.option(
            "--sensor",
            type=SensorSize(),
            help="Size of the sensor in pixels, where the file does not say it.",
        ),
    )

    def with_choices(
        preset: str | None,
        assignments: tuple[str, ...],
        window: tuple[int, int] | None,
        fixed_ball: tuple[float, float, float] | str | None,
        sensor: tuple[int, int] | None,
        **rest: Any,
    ) -> None:
        if window and window[0] >= window[1]:
            raise click.UsageError(f"--window {window[0]} {window[1]} is empty: START_US must be below END_US")
        command(choices=Choices(preset, assignments, window, fixed_ball, sensor), **rest)

    with_choices.__name__, with_choices.__doc__ = command.__name__, command.__doc__
    decorated: Callable[..., None] = with_choices
    for option in reversed(options):
        decorated = option(decorated)
    return decorated


def _tunables(command: Callable[..., None]) -> Callable[..., None]:
    """One option for each parameter of a simulated scene, from its declaration."""
    types: dict[str, Any] = {"number": float, "whole number": int}
    for name, declared in reversed(SceneParameters.tunables().items()):
        flag = "--" + name.replace("_", "-")
        help = f"{declared.help} [{declared.allowed}]"
        if declared.kind == "switch":
            command = click.option(flag, is_flag=True, help=declared.help)(command)
        else:
            kind = click.Choice(declared.choices) if declared.choices else types[declared.kind]
            command = click.option(flag, type=kind, default=None, help=help)(command)
    return command


@click.group(
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
        serve(DEFAULT_SAMPLE, Choices(), None, open_browser=True)


@cli.command()
@click.argument("recording", type=RECORDING)
@click.option("--sensor", type=SensorSize(), help="Size of the sensor in pixels, where the file does not say it.")
@click.option("--json", "output", type=click.Path(), help="Write JSON to this file, - for standard output.")
def info(recording: Path, sensor: tuple[int, int] | None, output: str | None) -> None:
    """Say what a recording holds: format, sensor, events, duration, rates, hot pixels, triggers, damage."""
    from .info import information, print_information

    with ProgressBar() as bar:
        found = information(recording, sensor, bar)
    if output:
        _write(output, json.dumps(found.as_dict(), allow_nan=False) + "\n")
    else:
        print_information(found)


@cli.command()
@click.argument("recordings", type=RECORDING, nargs=-1, required=True)
@click.option(
    "--json",
    "output",
    type=click.Path(),
    help="Write JSON, one object a recording and line, - for standard output.",
)
@click.option(
    "--method",
    type=click.Choice((*(method.name for method in methods()), "all")),
    default="all",
    show_default=True,
    help="Which estimates of the spin to report; only what they need is run.",
)
@_choices
def analyze(recordings: tuple[Path, ...], output: str | None, method: str, choices: Choices) -> None:
    """Find the shots of recordings and estimate their spin."""
    from .analyze import analyze as analyzed

    if output is not None and output != "-":
        check_writable(Path(output), "JSON")
    reports: list[dict[str, Any]] = []
    for recording in recordings:
        try:
            with ProgressBar() as bar:
                reports.append(analyzed(recording, choices, method, bar, cold=not reports))
        except SpinscopeError as error:
            if len(recordings) == 1:
                raise
            note(f"error: {error}")
            reports.append({"schema": 1, "recording": {"path": str(recording)}, "error": str(error)})
    if output is None:
        print_reports(reports)
    else:
        _write(output, "".join(json.dumps(report, allow_nan=False) + "\n" for report in reports))
    if any("error" in report for report in reports):
        sys.exit(2)


@cli.command()
@click.argument("recording", type=RECORDING)
@click.option(
    "--save",
    type=click.Path(path_type=Path),
    metavar="FILE.rrd",
    help="Write an .rrd file instead of opening the viewer.",
)
@click.option("--native", is_flag=True, help="Open Rerun's own window instead of the browser.")
@click.option("--layout", type=click.Choice(LAYOUTS), default="all", show_default=True, help="Which tab is in front.")
@_choices
def view(recording: Path, save: Path | None, native: bool, layout: str, choices: Choices) -> None:
    """Show every stage of a recording in the viewer."""
    _view(recording, save, native, layout, choices)


@cli.command(
    help=f"Write a recording in another format, chosen by the suffix of TARGET ({', '.join(writable_suffixes())})."
)
@click.argument("source", type=RECORDING)
@click.argument("target", type=RECORDING)
@click.option("--sensor", type=SensorSize(), help="Size of the sensor in pixels, where the file does not say it.")
def convert(source: Path, target: Path, sensor: tuple[int, int] | None) -> None:
    """Convert a recording."""
    from spinscope.pipeline.recordings import convert as converted

    with ProgressBar() as bar:
        converted(source, target, sensor=sensor, on_progress=lambda share: bar(share, "converting"))


@cli.command()
@click.argument("recording", type=RECORDING, default=DEFAULT_SAMPLE)
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    help="Port of the page; another free one is taken when it is busy.",
)
@click.option("--no-browser", is_flag=True, help="Only print the address.")
@_choices
def tune(recording: Path, port: int | None, no_browser: bool, choices: Choices) -> None:
    """Open a page with sliders beside the viewer: turn a knob, see the same instant change."""
    from .web import serve

    serve(recording, choices, port, open_browser=not no_browser)


@cli.command()
@click.argument("kind", type=click.Choice((*KINDS, "again")))
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    required=True,
    metavar="FILE",
    help="Recording to write: .h5 (with truth and scene), .raw (EVT3) or .npz.",
)
@click.option(
    "--spin-rps",
    type=float,
    nargs=3,
    metavar="X Y Z",
    help="Exact spin in the camera frame, rps, instead of --spin and --magnitude-rps.",
)
@click.option(
    "--logo",
    default="andro",
    show_default=True,
    metavar="NAME|PNG",
    help="Logo on the ball: a name, or a picture of your own.",
)
@click.option(
    "--biases",
    type=click.Path(path_type=Path),
    metavar="FILE.bias",
    help="Biases of the sensor; the paper's by default.",
)
@click.option(
    "--scene",
    type=RECORDING,
    metavar="FILE.h5",
    help="With `again`: the recording whose scene is simulated once more, with other --biases.",
)
@_tunables
def simulate(
    kind: str,
    out: Path,
    scene: Path | None,
    spin_rps: tuple[float, float, float] | None,
    logo: str,
    biases: Path | None,
    **options: Any,
) -> None:
    """Simulate a ball spinner, a flight or a rally, with exact truth: same seed and options, same events.

    `spinscope simulate again --scene FILE.h5 --biases FILE.bias --out OUT` takes a simulated scene once more.
    """
    from spinscope.pipeline.biases import read_biases
    from spinscope.pipeline.simulated_recordings import simulate_again_to_file, simulate_to_file

    if (kind == "again") != (scene is not None):
        raise ParameterError("`simulate again` and --scene FILE.h5 go together: give both or neither")
    values = read_biases(biases) if biases else None
    with ProgressBar() as bar:
        if scene is not None:
            if given := sorted(name for name, value in options.items() if value not in (None, False)):
                raise ParameterError(f"{given[0]} does not belong to `simulate again`: the scene stays as it is")
            written = simulate_again_to_file(scene, out, biases=values, on_progress=bar)
        else:
            written = simulate_to_file(
                kind, out, spin_rps=spin_rps, logo=logo, biases=values, on_progress=bar, **options
            )
    for warning in written.warnings:
        note(f"warning: {warning}")
    note(
        f"wrote {written.path}: {written.events:,} events, {written.logo_events:,} of the logo, "
        f"in {written.duration_us / 1000:.1f} ms"
    )


def _list_suites(context: click.Context, _: click.Parameter, wanted: bool) -> None:
    if wanted:
        from .evaluate import suite_list

        click.echo(suite_list())
        context.exit()


@cli.command()
@click.argument("suites", nargs=-1, required=True, metavar="SUITE...")
@click.option(
    "--list", is_flag=True, is_eager=True, expose_value=False, callback=_list_suites, help="List the suites and exit."
)
@click.option("--quick", is_flag=True, help="A thinned suite, about ten seconds.")
@click.option("--json", "output", type=click.Path(path_type=Path), metavar="OUT", help="Write JSON, one suite a line.")
@click.option("--figures", type=click.Path(path_type=Path), metavar="DIR", help="Write figures (PNG) and rows (CSV).")
@click.option("--page", type=click.Path(path_type=Path), metavar="FILE.md", help="Write tables and figures as a page.")
@click.option("--cluster", metavar="ADDRESS", help="Scheduler of a running Dask cluster that does the work.")
@click.option("--workers", type=click.IntRange(0), help="Processes on this machine; one a core by default.")
def evaluate(
    suites: tuple[str, ...],
    quick: bool,
    output: Path | None,
    figures: Path | None,
    page: Path | None,
    cluster: str | None,
    workers: int | None,
) -> None:
    """Run the paper's experiments on simulated recordings, next to the paper's own numbers.

    `spinscope evaluate --list` lists the suites. Recordings and results are kept, so that an interrupted run resumes
    where it stopped.
    """
    from . import evaluate as running

    done, pictures = [], []
    for suite in suites:
        with ProgressBar() as bar:
            done.append(running.evaluate_suite(suite, quick=quick, workers=workers, cluster=cluster, on_progress=bar))
        running.print_evaluation(done[-1])
        if figures:
            for path in running.write_figures(done[-1], figures):
                note(f"wrote {path}")
                pictures.append(path)
    if output:
        running.write_json(done, output)
    if page:
        running.write_page(done, page, pictures)


def _write(output: str, text: str) -> None:
    """Write text to a file, which appears whole or not at all, or to standard output for "-"."""
    if output == "-":
        click.echo(text, nl=False)
    else:
        with atomic_file(output, "JSON") as part:
            part.write_text(text, encoding="utf-8")


def _view(recording: Path, save: Path | None, native: bool, layout: str, choices: Choices) -> None:
    from . import viewer

    if native and not save:
        viewer.require_display()
    with ProgressBar() as bar:
        session = Session.open(recording, choices, bar)
        session = session.clip_for_viewing(bar)
        result = session.estimate_keeping_ticks(bar)
        for warning in session.warnings:
            note(f"warning: {warning}")
        if save:
            viewer.save(result, save, layout=layout)
    if save:
        note(f"saved {save} ({save.stat().st_size / 1e6:.1f} MB): `uv run rerun {save}` opens it")
    else:
        viewer.show(result, layout=layout, native=native)


def _join_fixed_ball(arguments: list[str]) -> list[str]:
    """Make one value of `--fixed-ball X Y RADIUS`; click takes a fixed number of values and `auto` is one."""
    if "--fixed-ball" not in arguments:
        return arguments
    at = arguments.index("--fixed-ball") + 1
    if arguments[at : at + 1] == ["auto"] or "," in "".join(arguments[at : at + 1]):
        return arguments
    return [*arguments[:at], ",".join(arguments[at : at + 3]), *arguments[at + 3 :]]


def main() -> None:
    """Entry point: our errors and click's become one line on standard error and exit status 2."""
    announce_compilation()
    try:
        cli.main(_join_fixed_ball(sys.argv[1:]), prog_name="spinscope", standalone_mode=False)
    except SpinscopeError as error:
        message = str(error)
    except click.exceptions.Exit as error:
        sys.exit(error.exit_code)
    except click.Abort:
        sys.exit(130)
    except click.ClickException as error:
        message = " ".join(error.format_message().split())
        context = getattr(error, "ctx", None)
        if context is not None:
            message += f" (`{context.command_path} --help` explains)"
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(0)
    else:
        return
    note(f"spinscope: {message}")
    sys.exit(2)
