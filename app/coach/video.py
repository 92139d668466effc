"""Short video of a shot for a messenger: the turning ball with its numbers, drawn without a screen."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spinscope.pipeline.errors import ParameterError

from ..video_encoder import FRAMES_HZ, encode_video
from .ball_picture import GROUND, ball_picture
from .shot_words import ShotWords

Bytes = NDArray[np.uint8]

WIDTH_PX, HEIGHT_PX, BALL_PX = 720, 900, 600
SECONDS = 6.0  # of the video: the shot as slowly as that takes
TEXT, FAINT = (21, 25, 30), (82, 91, 102)


def write_video(shot: Mapping[str, Any], detail: Mapping[str, Any], path: Path, words: ShotWords) -> None:
    """Write a shot's video as .mp4 (H.264); raises SpinscopeError.

    It needs imageio-ffmpeg, which is an extra.
    """
    if shot["spin_rps"] is None:
        raise ParameterError(f"the spin of this shot is not seen ({shot['reason']}): there is no turning ball to show")
    source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{WIDTH_PX}x{HEIGHT_PX}"]
    encode_video((frame.tobytes() for frame in video_frames(shot, detail, words)), source, path)


def video_frames(shot: Mapping[str, Any], detail: Mapping[str, Any], words: ShotWords) -> Iterator[Bytes]:
    """(HEIGHT_PX, WIDTH_PX, 3) uint8 RGB pictures of the shot in slow motion; the last is followed by the first."""
    ground = _ground(shot, words)
    left, top = (WIDTH_PX - BALL_PX) // 2, 20
    for t_us in np.linspace(shot["start_us"], shot["end_us"], int(SECONDS * FRAMES_HZ), endpoint=False):
        ball = ball_picture(detail, BALL_PX, float(t_us), finer=1)
        assert ball is not None
        frame = ground.copy()
        frame[top : top + BALL_PX, left : left + BALL_PX] = ball
        yield frame


def _ground(shot: Mapping[str, Any], words: ShotWords) -> Bytes:
    """The picture without the ball: spin, kind, speed, slow motion."""
    from matplotlib.font_manager import findfont
    from PIL import Image, ImageDraw, ImageFont

    picture = Image.new("RGB", (WIDTH_PX, HEIGHT_PX), GROUND)
    draw = ImageDraw.Draw(picture)
    slowness = SECONDS / max((shot["end_us"] - shot["start_us"]) * 1e-6, 1e-3)
    lines = (
        (words.spin(shot["spin_rps"]), 88, TEXT),
        (words.kind(shot), 36, TEXT),
        (", ".join(filter(None, (words.speed(shot["speed_m_s"]), shot["player"]))), 32, FAINT),
        (f"{words.text('slow')} 1/{slowness:.0f}", 20, FAINT),
    )
    y = float(20 + BALL_PX + 10)
    for text, size_px, colour in lines:
        font = ImageFont.truetype(findfont("DejaVu Sans"), size_px)
        while (width := draw.textlength(text, font)) > WIDTH_PX - 40 and size_px > 12:
            size_px -= 2
            font = ImageFont.truetype(findfont("DejaVu Sans"), size_px)
        draw.text(((WIDTH_PX - width) / 2, y), text, colour, font)
        y += 1.3 * size_px
    return np.asarray(picture, np.uint8)
