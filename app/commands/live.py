"""`spinscope live` and `spinscope watch`: the shots of a camera, or of what is played or simulated in its place."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from spinscope.pipeline.cameras import FAULTS, CameraOptions
from spinscope.pipeline.session import Choices, check_method

from .options import RECORDING, page_options, session_options

SOURCE_OPTIONS = (
    click.option("--camera", "serial", metavar="SERIAL", help="Serial number; the only camera by default."),
    click.option("--biases", type=click.Path(path_type=Path), metavar="FILE.bias", help="Biases to set."),
    click.option("--roi", "roi_px", type=int, nargs=4, metavar="X Y W H", help="Region of interest of the camera."),
    click.option("--most-mev-s", type=click.FloatRange(min=0, min_open=True), help="Event rate above which it drops."),
    click.option("--replay", type=RECORDING, metavar="FILE", help="Play a recording in the place of a camera."),
    click.option("--simulate", "simulates", is_flag=True, help="Simulate a camera, on whose events biases act."),
    click.option(
        "--speed", type=float, default=1.0, show_default=True, help="Of --replay, --simulate; inf: no waiting."
    ),
    click.option("--loop", "loops", is_flag=True, help="Play the recording again and again."),
    click.option("--fake", "fault", type=click.Choice(FAULTS), help="Have the replay misbehave every second."),
    click.option("--record", type=click.Path(path_type=Path), metavar="NAME.raw", help="Record the events."),
    click.option("--split-mb", type=click.FloatRange(min=1), help="With --record: begin another file at this size."),
    click.option("--split-s", type=click.FloatRange(min=1), help="With --record: begin another file after so long."),
    click.option(
        "--socket", "socket_port", type=click.IntRange(0, 65535), help="Send lines of every tick to robots here."
    ),
    click.option("--method", default="all", show_default=True, help="Which spin method to run."),
)


def source_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options of a live run to a command."""
    for option in reversed(SOURCE_OPTIONS):
        command = option(command)
    return command


@click.command()
@click.option("--headless", is_flag=True, help="Without a page: lines of JSON.")
@click.option("--jsonl", "lines", metavar="OUT", help="File or pipe of the lines; - for standard output.")
@click.option(
    "--keep-s", type=click.FloatRange(1, 120), default=30.0, show_default=True, help="Last seconds that can be seen."
)
@page_options
@click.option("--sweep", metavar="BIAS", help="With --headless: step through a bias, measure, propose a value, end.")
@click.option("--sweep-points", type=int, default=9, show_default=True, help="Values of the bias.")
@click.option("--sweep-s", type=float, default=2.0, show_default=True, help="Time for each of them.")
@click.option("--sweep-figure", type=click.Path(path_type=Path), metavar="OUT.png", help="Draw the event rates.")
@source_options
@session_options
def live(
    headless: bool,
    lines: str | None,
    keep_s: float,
    page: dict[str, Any],
    sweep: str | None,
    sweep_points: int,
    sweep_s: float,
    sweep_figure: Path | None,
    **options: Any,
) -> None:
    """Show a running camera: in the tuner's page, or as lines of JSON of its shots as they end.

    The page shows the camera's picture and state, changes parameters and biases while it runs, and opens its last
    seconds and every shot so far, to be scrubbed, compared and tuned while the camera runs on.
    """
    if sweep is not None and not headless:
        raise click.UsageError("--sweep goes with --headless; the page has a sweep of its own")
    if headless:
        swept = {"name": sweep, "points": sweep_points, "measured_s": sweep_s, "figure": sweep_figure}
        run_camera(lines=lines or "-", sweep=None if sweep is None else swept, **options)
    else:
        run_camera(lines=lines, page={**page, "kept_s": keep_s}, **options)


@click.command()
@click.argument("table", type=click.Path(path_type=Path), metavar="TABLE.csv|.jsonl|.parquet")
@click.option("--jsonl", "lines", metavar="OUT", help="Lines of JSON besides, as of `live`.")
@source_options
@session_options
def watch(table: Path, lines: str | None, **options: Any) -> None:
    """Append every shot of a running camera to a table, and save its events as a small recording of its own.

    The same command goes on with a table that is there.
    """
    run_camera(lines=lines, table=table, **options)


def run_camera(
    *,
    lines: str | None,
    serial: str | None,
    biases: Path | None,
    roi_px: tuple[int, int, int, int] | None,
    most_mev_s: float | None,
    replay: Path | None,
    simulates: bool,
    speed: float,
    loops: bool,
    fault: str | None,
    record: Path | None,
    split_mb: float | None,
    split_s: float | None,
    socket_port: int | None,
    method: str,
    choices: Choices,
    table: Path | None = None,
    sweep: dict[str, Any] | None = None,
    page: dict[str, Any] | None = None,
    coached: dict[str, Any] | None = None,
) -> None:
    """Run a camera: with the tuner's page or the coach's (arguments of either), or without one."""
    from ..live.headless import Outputs, SweepChoice, run_headless
    from ..live.opening import CameraChoice
    from ..live.recording import RecordChoice

    if record is None and (split_mb or split_s):
        raise click.UsageError("--split-mb and --split-s go with --record NAME.raw")
    chosen = CameraChoice(
        serial=serial,
        biases=biases,
        options=CameraOptions(roi_px, most_mev_s),
        replay=replay,
        simulates=simulates,
        speed=speed,
        loops=loops,
        fault=fault,
    )
    recording = None if record is None else RecordChoice(record, split_mb, split_s, goes_on=table is not None)
    swept = None if sweep is None else SweepChoice(**sweep)
    to = Outputs(lines=lines, port=socket_port, table=table, record=recording, sweep=swept)
    if page is not None:
        from ..live.page import run_with_page

        run_with_page(chosen, choices, check_method(method), to, **page)
    elif coached is not None:
        from ..live.coach_page import run_with_coach

        run_with_coach(chosen, choices, check_method(method), to, **coached)
    else:
        run_headless(chosen, choices, check_method(method), to)
