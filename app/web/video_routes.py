"""Route of the video of a view: the page sends its pictures, the server puts them together."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from fastapi import FastAPI, HTTPException, Request, Response
from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect

from spinscope.app.video_encoder import encode_video

from .security import VIDEO_PATH

VIDEO_BYTES = 500_000_000  # of its pictures: 300 of them of a large screen take a fifth
PART_BYTES = 1 << 20
JPEGS = ("-f", "mjpeg")  # one JPEG after the other


def add_video_routes(app: FastAPI) -> None:
    """Add the route."""

    @app.post(VIDEO_PATH)
    async def video(request: Request) -> Response:
        with TemporaryDirectory(prefix="spinscope-video-") as folder:
            pictures, made, room = Path(folder) / "pictures", Path(folder) / "view.mp4", VIDEO_BYTES
            try:
                with pictures.open("wb") as file:
                    async for part in request.stream():
                        room -= len(part)
                        if room < 0:
                            raise HTTPException(413, f"the pictures are longer than {VIDEO_BYTES / 1e6:.0f} MB")
                        file.write(part)
            except ClientDisconnect:
                raise HTTPException(408, "the rest of the pictures did not come") from None
            await run_in_threadpool(encode_video, _parts(pictures), JPEGS, made)
            return Response(made.read_bytes(), media_type="video/mp4")


def _parts(path: Path) -> Iterator[bytes]:
    with path.open("rb") as file:
        while part := file.read(PART_BYTES):
            yield part
