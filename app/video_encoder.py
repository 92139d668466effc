"""Encoder of short videos: pictures to .mp4 (H.264) by ffmpeg, which comes with the extra `video`."""

from __future__ import annotations

import importlib
import subprocess
import threading
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from spinscope.pipeline.errors import ParameterError, RecordingError
from spinscope.pipeline.files import atomic_file

FRAMES_HZ = 25
ENCODING_S = 300.0  # a video of some hundred pictures takes seconds; ffmpeg is ended after so long


def encode_video(pictures: Iterable[bytes], source: Sequence[str], path: Path) -> None:
    """Write pictures as a video, whole or not at all.

    Parameters
    ----------
    pictures : iterable of bytes
        In order of time, FRAMES_HZ a second; cut anywhere.
    source : sequence of str
        Options of ffmpeg that say what they are.
    path : Path
        Of the video, ending in .mp4.

    Raises
    ------
    SpinscopeError
        Where imageio-ffmpeg is not installed, the name is another, or the pictures are none.
    """
    if path.suffix.lower() != ".mp4":
        raise ParameterError(f"a video ends in .mp4: give such a name instead of {path}")
    try:
        ffmpeg: Any = importlib.import_module("imageio_ffmpeg")
    except ImportError:
        raise ParameterError("a video needs imageio-ffmpeg: install it with `pip install spinscope[video]`") from None
    given = [*source, "-r", str(FRAMES_HZ), "-i", "-"]
    # H.264 with colours at half the resolution has even sides; every player takes it.
    coded = ["-an", "-vf", "crop=trunc(iw/2)*2:trunc(ih/2)*2", "-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "23"]
    with atomic_file(path, "video") as part:
        written = ["-movflags", "+faststart", "-f", "mp4", str(part)]
        command = [ffmpeg.get_ffmpeg_exe(), "-y", "-loglevel", "error", *given, *coded, *written]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as process:
            assert process.stdin is not None and process.stderr is not None
            limit = threading.Timer(ENCODING_S, process.kill)
            limit.start()
            try:
                for picture in pictures:
                    process.stdin.write(picture)
                process.stdin.close()
                said = process.stderr.read().decode(errors="replace")
            except BrokenPipeError:
                said = process.stderr.read().decode(errors="replace")  # the encoder says why
            finally:
                limit.cancel()
        if process.returncode:
            raise RecordingError(f"the video cannot be written ({' '.join(said.split())[:200]}): {path}")
