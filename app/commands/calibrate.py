"""`spinscope calibrate`: the camera, a frame camera beside it, the pixels' latency and outline, the table's pose."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from spinscope.pipeline.recordings import ReadingOptions

from ..terminal import ProgressBar, note
from .options import RECORDING, CommandGroup, FixedBall, reading_options

if TYPE_CHECKING:
    from spinscope.pipeline.calibration.board import Pattern


class BoardSize(click.ParamType[tuple[int, int]]):
    """COLUMNSxROWS of inner corners."""

    name = "COLUMNSxROWS"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, int]:
        """Value of the option; fails with what is allowed."""
        columns, _, rows = str(value).lower().partition("x")
        if not (columns.isdecimal() and rows.isdecimal()):
            self.fail(f"{value!r} is not a board: write its inner corners as COLUMNSxROWS, like 9x6", param, ctx)
        return int(columns), int(rows)


@click.group(cls=CommandGroup)
def calibrate() -> None:
    """Calibrate the camera, a frame camera beside it, the pixels' latency and outline, and the table's pose."""


@calibrate.command()
@click.argument("recordings", nargs=-1, required=True, type=RECORDING, metavar="FILE...")
@click.option("--board", type=BoardSize(), help="Inner corners of the blinking board, like 9x6.")
@click.option("--square-mm", type=float, help="Side of the board's squares on the screen, in mm.")
@click.option("--pattern", type=click.Choice(["chessboard", "charuco"]), default="chessboard", show_default=True)
@click.option("--ball-distance-m", type=float, help="Instead of a board: distance from lens to a ball, in m.")
@click.option("--ball-mm", type=float, default=40.0, show_default=True, help="Diameter of that ball.")
@click.option("--fixed-ball", type=FixedBall(), default="auto", show_default=True, help="Circle of that ball.")
@click.option("--pixel-um", type=float, default=4.86, show_default=True, help="Pitch of the pixels.")
@click.option("--out", type=click.Path(path_type=Path), required=True, metavar="FILE.toml", help="Preset to write.")
@reading_options
def camera(
    recordings: tuple[Path, ...],
    board: tuple[int, int] | None,
    square_mm: float | None,
    pattern: Pattern,
    ball_distance_m: float | None,
    ball_mm: float,
    fixed_ball: tuple[float, float, float] | str,
    pixel_um: float,
    out: Path,
    reading: ReadingOptions,
) -> None:
    """Find focal length, principal point and distortion from recordings of a blinking board.

    Show a chessboard with a white margin on a screen that blinks (white squares on and off, a few times a second), and
    move and tilt it between the flashes, into the image's corners, too. FILE.toml goes with --preset; its [camera]
    table is also a sidecar's. A picture of the coverage is written beside it. With --ball-distance-m the focal length
    alone is found, from one recording of a ball on a spinner.
    """
    from .. import calibration as running

    if (board is None) == (ball_distance_m is None):
        raise click.UsageError("give --board COLUMNSxROWS with --square-mm, or --ball-distance-m")
    with ProgressBar() as bar:
        if ball_distance_m is not None:
            if len(recordings) != 1:
                raise click.UsageError("a ball is measured in one recording: give one FILE")
            said = running.calibrate_by_ball(
                recordings[0], ball_distance_m, ball_mm, fixed_ball, pixel_um, reading, out
            )
        else:
            assert board is not None
            if square_mm is None:
                raise click.UsageError("how large are the board's squares? give --square-mm")
            said = running.calibrate_by_board(recordings, board, square_mm, pattern, pixel_um, reading, out, bar)
    for line in said:
        note(line)


@calibrate.command()
@click.argument("folder", type=click.Path(path_type=Path, exists=True, file_okay=False))
@click.option("--board", type=BoardSize(), required=True, help="Inner corners of the board, like 9x6.")
@click.option("--square-mm", type=float, required=True, help="Side of the board's squares on the screen, in mm.")
@click.option("--pattern", type=click.Choice(["chessboard", "charuco"]), default="chessboard", show_default=True)
@click.option("--camera", "preset", required=True, metavar="FILE.toml", help="The calibrated event camera.")
@click.option(
    "--frame-camera", metavar="FILE.toml", help="The calibrated frame camera; by default the pictures calibrate it."
)
@click.option("--out", type=click.Path(path_type=Path), required=True, metavar="FILE.toml", help="File to write.")
@reading_options
def stereo(
    folder: Path,
    board: tuple[int, int],
    square_mm: float,
    pattern: Pattern,
    preset: str,
    frame_camera: str | None,
    out: Path,
    reading: ReadingOptions,
) -> None:
    """Find where a frame camera stands beside the event camera.

    FOLDER holds, for each pose of the board, a recording of it blinking (NAME.raw) and a picture of it (NAME.png). With
    `camera_frame = "FILE.toml"` in a sidecar's [truth], spins measured by the frame camera are turned into the event
    camera's frame.
    """
    from .. import calibration as running

    for line in running.calibrate_second_camera(folder, board, square_mm, pattern, preset, frame_camera, reading, out):
        note(line)


@calibrate.command()
@click.argument("recordings", nargs=-1, required=True, type=RECORDING, metavar="FILE...")
@click.option("--disc", type=float, nargs=3, metavar="X Y RADIUS", help="Axis of the disc, and its marks, in px.")
@click.option("--channel", type=click.IntRange(0, 255), help="Trigger input, where there are several.")
@click.option(
    "--distance-m",
    "distances_m",
    type=click.FloatRange(0.1, 20.0),
    multiple=True,
    help="Instead of a disc: distance from lens to ball, once for each FILE with a shot.",
)
@click.option("--camera", "preset", metavar="FILE.toml", help="The calibrated camera, which is written as well.")
@click.option("--out", type=click.Path(path_type=Path), required=True, metavar="FILE.toml", help="Preset to write.")
@reading_options
def latency(
    recordings: tuple[Path, ...],
    disc: tuple[float, float, float] | None,
    channel: int | None,
    distances_m: tuple[float, ...],
    preset: str | None,
    out: Path,
    reading: ReadingOptions,
) -> None:
    """Find how late and how far outside the pixels report an edge (track.latency_us, track.outline_px).

    With --disc: how late. Let a disc with marks turn before the camera, facing it, with a pulse a turn on the trigger
    input (a light barrier). Record it at two speeds or more, turning the same way.

    With --distance-m: how far outside a ball its outline is seen, beside what the tracker tells of lens and ground from
    the events behind each ball. Record shots that cross the image at known distances, at two or more of them, some
    shots at each.
    """
    from .. import calibration as running

    if (disc is None) == (not distances_m):
        raise click.UsageError("give --disc of a turning disc, or --distance-m of shots")
    if disc is not None:
        said = running.calibrate_latency(recordings, disc, channel, preset, reading, out)
    elif len(distances_m) != len(recordings):
        raise click.UsageError(
            f"{len(recordings)} files with {len(distances_m)} distances: give --distance-m once for each FILE"
        )
    else:
        said = running.calibrate_outline(recordings, distances_m, preset, reading, out)
    for line in said:
        note(line)


@calibrate.command()
@click.option(
    "--corners",
    type=float,
    nargs=8,
    required=True,
    metavar="X1 Y1 X2 Y2 X3 Y3 X4 Y4",
    help="The table's corners in the image, in order round it, px; its y axis runs from the first along a long side.",
)
@click.option("--camera", "preset", required=True, metavar="FILE.toml", help="The calibrated camera.")
@click.option("--size", type=BoardSize(), default="1280x720", show_default=True, help="Sensor, in px.")
@click.option("--out", type=click.Path(path_type=Path), required=True, metavar="FILE.toml", help="Preset to write.")
def table(corners: tuple[float, ...], preset: str, size: tuple[int, int], out: Path) -> None:
    """Find the direction up (camera.up) from the table's four corners, and write it with the camera.

    The table's frame is written beside it, as FILE.frame.toml: with `camera_frame = "FILE.frame.toml"` in a sidecar's
    [truth], spins measured in it (y along the table, z up), as of SpinDOE's trajectories, are turned into the camera's.
    """
    from .. import calibration as running

    pairs = list(zip(corners[::2], corners[1::2], strict=True))
    for line in running.calibrate_table(pairs, preset, size, out):
        note(line)
