"""`spinscope simulate`: a scene of the simulator as a recording with exact truth."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from spinscope.pipeline.errors import ParameterError
from spinscope.pipeline.simulated_recordings import KINDS, SceneParameters

from ..terminal import ProgressBar, note
from .options import RECORDING


def _tunables(command: Callable[..., None]) -> Callable[..., None]:
    """Add one option for each parameter of a simulated scene, from its declaration."""
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


@click.command()
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
    metavar="FILE.bias|FILE.json",
    help="Biases of the sensor, a .bias file or the JSON of camera settings; the paper's by default.",
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
    made = written.recording
    counts = f"{len(made.events):,} events, {made.logo_events:,} of the logo"
    note(f"wrote {written.path}: {counts}, in {made.duration_us / 1000:.1f} ms")
