"""`spinscope live`: shots and spins of a running camera, or of a recording in its place."""

from __future__ import annotations

from pathlib import Path

import click

from spinscope.pipeline.cameras import FAULTS
from spinscope.pipeline.session import Choices, check_method

from .options import RECORDING, session_options


@click.command()
@click.option("--camera", "serial", metavar="SERIAL", help="Camera of this serial number; the only one by default.")
@click.option("--biases", type=click.Path(path_type=Path), metavar="FILE.bias", help="Biases to set.")
@click.option("--replay", type=RECORDING, metavar="FILE", help="Play a recording in the place of a camera.")
@click.option(
    "--speed", type=float, default=1.0, show_default=True, help="Of the replay, in real times; inf: no waiting."
)
@click.option("--loop", "loops", is_flag=True, help="Play the recording again and again.")
@click.option("--fake", "fault", type=click.Choice(FAULTS), help="Have the replay misbehave every second.")
@click.option("--headless", is_flag=True, help="Without a page: lines of JSON.")
@click.option("--jsonl", "output", default="-", metavar="OUT", help="File or pipe of the lines; - is standard output.")
@click.option("--socket", "port", type=click.IntRange(0, 65535), help="Send lines of every tick to robots here.")
@click.option("--method", default="all", show_default=True, help="Which spin method to run.")
@session_options
def live(
    serial: str | None,
    biases: Path | None,
    replay: Path | None,
    speed: float,
    loops: bool,
    fault: str | None,
    headless: bool,
    output: str,
    port: int | None,
    method: str,
    choices: Choices,
) -> None:
    """Show the shots of a running camera as they end, one line of JSON each, and the state every second."""
    from ..live.headless import run_headless
    from ..live.opening import CameraChoice

    chosen = CameraChoice(serial=serial, biases=biases, replay=replay, speed=speed, loops=loops, fault=fault)
    run_headless(chosen, choices, check_method(method), output, port=port)
