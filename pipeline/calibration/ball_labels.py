"""Places of the ball from blobs in accumulated frames: truth for the ball detector, without its algorithms.

The supplement ("Generating ground truth for the ball detector benchmark") accumulates events over 10 ms and takes the
blob's place for the ball's. In that time a ball flies by one to three of its diameters: the blob is a stadium, whose
middle is the ball's place in the middle of the exposure, and whose width is the ball's diameter.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import RecordingError
from ..events import EventBatch
from ..files import atomic_file, file_bytes

Floats = NDArray[np.float64]

EXPOSURE_US, STEP_US = 10_000, 2_500  # the supplement's; four labels an exposure, for its motion to be followed
LATENCY_US = 40.0  # of the pixels, as `track.latency_us`: events show the scene of so long before
# How far outside the ball its edge leaves events, and how far behind it both edges together: means of 15 simulated
# flights of 4 to 12 m/s (seeds 78001 to 78003), which scatter by 0.08 px about each of them.
OUTSIDE_PX, LAG_PX = 0.81, 0.18
NEIGHBOURS = 2  # events around an event that is no noise: a pixel's eight neighbours hold so many
CLOSING_PX = 5  # gaps that an outline of few events may have
OPENING_SHARE = 0.5  # disc that fits into the area everywhere, over the ball's diameter: what does not hold it is noise
LEAST_FILL = 0.9  # area of the blob's hull over that of the stadium of its length and width
LEAST_LENGTH = 1.15  # a blob's length over its width: what moves less is no ball in flight
RADIUS_RANGE_PX = (3.0, 200.0)
LINK_RADII = 1.0  # how far a blob may lie from where its predecessor goes on
DEGREE = 4  # in time, of the path of a ball in the image: gravity, drag and perspective
LEAST_LABELS = 8  # of one ball: fewer have no error of their own
LEAST_STD_PX = 0.05  # what scatter along a smooth path does not show
MOST_BYTES = 100_000_000
DETECTED, ACCEPTED, MOVED = STATES = "detected", "accepted", "moved"


@dataclass(frozen=True, eq=False)
class BallLabels:
    """Labelled places of the balls of a recording, n in order of time, ball by ball.

    Attributes
    ----------
    t_us : (n,) float64
        Scene time, file time less the pixels' latency.
    x_px, y_px, radius_px : (n,) float64
        Silhouette of the ball.
    std_px : (n,) float64
        1 sigma of the place in each direction, by the scatter about a smooth path.
    ball : (n,) int64
        Number of the flight, from 1.
    state : (n,) str
        DETECTED by the program, ACCEPTED by somebody as it is, or MOVED by hand.
    """

    t_us: Floats
    x_px: Floats
    y_px: Floats
    radius_px: Floats
    std_px: Floats
    ball: NDArray[np.int64]
    state: NDArray[np.str_]

    def of_ball(self, number: int) -> BallLabels:
        """The labels of one flight."""
        return self._at(self.ball == number)

    def spliced(self, first: int, removed: int, others: BallLabels) -> BallLabels:
        """The labels with `others` in the place of `removed` of them from `first` on."""
        before, after = self._at(slice(first)), self._at(slice(first + removed, None))
        return BallLabels.concatenate([before, others, after])

    @classmethod
    def concatenate(cls, parts: Sequence[BallLabels]) -> BallLabels:
        """All labels of several parts, in their order."""
        return cls(**{field.name: np.concatenate([getattr(one, field.name) for one in parts]) for field in fields(cls)})

    def _at(self, chosen: slice | NDArray[np.bool_]) -> BallLabels:
        return BallLabels(**{field.name: getattr(self, field.name)[chosen] for field in fields(self)})

    def write(self, path: Path) -> None:
        """Write a CSV with these columns, which appears whole or not at all; raises RecordingError."""
        text = io.StringIO(newline="")
        writer = csv.writer(text, lineterminator="\n")
        names = [field.name for field in fields(self)]
        writer.writerow(names)
        for row in zip(*(getattr(self, name).tolist() for name in names), strict=True):
            writer.writerow([f"{value:.3f}" if isinstance(value, float) else value for value in row])
        with atomic_file(path, "labels") as part:
            part.write_text(text.getvalue(), encoding="utf-8")

    @classmethod
    def read(cls, path: Path) -> BallLabels:
        """Labels from a CSV with these columns, DETECTED without `state`; raises RecordingError for anything else."""
        return cls.of_csv(label_bytes(path), path)

    @classmethod
    def of_csv(cls, content: bytes, path: Path) -> BallLabels:
        """The same from the content of the file at a path."""
        *names, state = (field.name for field in fields(cls))
        try:
            lines = list(csv.DictReader(content.decode("utf-8-sig").splitlines()))
            columns = [np.array([float(line[name]) for line in lines]) for name in names]
            states = [line.get(state, DETECTED) for line in lines]
            if wrong := set(states).difference(STATES):
                raise ValueError(f"state {wrong.pop()} is none of {', '.join(STATES)}")
        except (KeyError, TypeError, ValueError) as error:
            raise RecordingError(
                f"labels are a CSV with the columns {', '.join(names)}, as `spinscope label` writes them "
                f"({error}): {path}"
            ) from None
        if not lines or not all(np.isfinite(column).all() for column in columns):
            raise RecordingError(f"labels hold no line, or no number in one: {path}")
        read: dict[str, Any] = dict(zip(names, columns, strict=True))
        return cls(**{**read, "ball": columns[-1].astype(np.int64), state: np.array(states)})


def label_bytes(path: Path) -> bytes:
    """Content of a file of labels; raises RecordingError."""
    try:
        return file_bytes(path, MOST_BYTES)
    except OSError as error:
        raise RecordingError(f"labels cannot be read ({error.strerror}): {path}") from error


def labels_beside(recording: Path) -> Path:
    """Path of the labels of a recording, NAME.labels.csv beside it."""
    return recording.with_suffix(".labels.csv")


@dataclass(frozen=True, slots=True)
class _Blob:
    """Stadium in one frame: middle of the exposure, centre, unit direction, travelled px, radius."""

    t_us: float
    centre: Floats
    direction: Floats
    travelled_px: float
    radius_px: float


def ball_labels(events: EventBatch, size: tuple[int, int]) -> BallLabels:
    """Label the balls in flight.

    Parameters
    ----------
    events : EventBatch
        In order of time.
    size : (int, int)
        Height and width of the sensor.

    Returns
    -------
    BallLabels
        Of every flight that leaves LEAST_LABELS stadiums or more, all of it in view.

    Raises
    ------
    RecordingError
        Where no ball flies.
    """
    flights: list[list[_Blob]] = []
    first_us, last_us = (int(events.t_us[place]) for place in (0, -1)) if len(events) else (0, 0)
    for begin_us in range(first_us, last_us - EXPOSURE_US + 1, STEP_US):
        for blob in _blobs(events.between(begin_us, begin_us + EXPOSURE_US), begin_us, size):
            for flight in flights:
                if _goes_on(flight, blob):
                    flight.append(blob)
                    break
            else:
                flights.append([blob])
    kept = [flight for flight in flights if len(flight) >= LEAST_LABELS]
    if not kept:
        raise RecordingError(
            "no ball in flight leaves a blob in accumulated frames: labels need balls of 1.5 m/s or more that cross "
            "the image alone, before a background that is at rest"
        )
    return BallLabels.concatenate([_labels(flight, number) for number, flight in enumerate(kept, start=1)])


def _labels(flight: list[_Blob], number: int) -> BallLabels:
    """Labels of one flight, along a smooth path: corrected for the pixels' lag and for speed that changes.

    The stadium's middle is that of the places at both ends of the exposure T; the place at its middle lies a T^2 / 8
    before it for an acceleration a.
    """
    t_us = np.array([blob.t_us for blob in flight])
    places = np.array([blob.centre for blob in flight])
    scale_us = max(float(np.ptp(t_us)), 1.0)
    t = (t_us - t_us.mean()) / scale_us
    path = np.polynomial.polynomial.polyfit(t, places, DEGREE)
    velocity, acceleration = (
        np.polynomial.polynomial.polyval(t, np.polynomial.polynomial.polyder(path, order)).T / scale_us**order
        for order in (1, 2)
    )
    off = places - np.polynomial.polynomial.polyval(t, path).T
    std_px = math.sqrt(float(np.sum(off**2)) / (2 * (len(flight) - DEGREE - 1)))
    speed = np.linalg.norm(velocity, axis=1)[:, None]
    x, y = (places - acceleration * EXPOSURE_US**2 / 8 + LAG_PX * velocity / np.maximum(speed, 1e-12)).T
    return BallLabels(
        t_us=t_us,
        x_px=x,
        y_px=y,
        radius_px=np.array([blob.radius_px for blob in flight]),
        std_px=np.full(len(flight), math.hypot(std_px, LEAST_STD_PX)),
        ball=np.full(len(flight), number, np.int64),
        state=np.full(len(flight), DETECTED),
    )


def _blobs(events: EventBatch, begin_us: int, size: tuple[int, int]) -> Iterator[_Blob]:
    """The stadiums of a frame that do not touch the image's border."""
    import cv2

    seen = np.zeros(size, np.uint8)
    seen[events.y_px, events.x_px] = 1
    around = cv2.boxFilter(seen, -1, (3, 3), normalize=False, borderType=cv2.BORDER_CONSTANT)
    seen[around <= NEIGHBOURS] = 0
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (CLOSING_PX, CLOSING_PX))
    count, part, boxes, _ = cv2.connectedComponentsWithStats(cv2.dilate(seen, kernel))
    for number in range(1, count):
        x, y, width, height = (int(value) for value in boxes[number][:4])
        if x == 0 or y == 0 or x + width == size[1] or y + height == size[0] or min(width, height) < RADIUS_RANGE_PX[0]:
            continue
        mine = seen[y : y + height, x : x + width] & (part[y : y + height, x : x + width] == number)
        swept = _without_spurs(mine.astype(np.uint8), kernel)
        hull = cv2.convexHull(cv2.findNonZero(swept)) if swept.any() else ()
        if len(hull) >= 5:
            blob = _stadium(np.reshape(hull, (-1, 2)) + np.array([x, y]) - CLOSING_PX, begin_us)
            if blob is not None:
                yield blob


def _without_spurs(mine: NDArray[np.uint8], kernel: NDArray[Any]) -> NDArray[np.uint8]:
    """The area that a ball swept, filled, without noise that sticks to it; CLOSING_PX larger on every side."""
    import cv2

    padded = cv2.copyMakeBorder(mine, *(CLOSING_PX,) * 4, cv2.BORDER_CONSTANT)
    closed = cv2.morphologyEx(padded, cv2.MORPH_CLOSE, kernel)
    outlines, _ = cv2.findContours(closed, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    filled = cv2.drawContours(np.zeros_like(closed), outlines, -1, 1, cv2.FILLED)
    side = int(OPENING_SHARE * min(mine.shape)) | 1  # odd, as a disc in pixels has a middle
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    return np.asarray(cv2.morphologyEx(filled, cv2.MORPH_OPEN, disc), np.uint8)


def _stadium(hull_px: Floats, begin_us: int) -> _Blob | None:
    """The stadium with this hull (n, 2) of pixels; None where it is none."""
    import cv2

    outline = hull_px.astype(np.float32).reshape(-1, 1, 2)
    moments = cv2.moments(outline)
    area = moments["m00"]
    if area <= 0:
        return None
    centre = np.array([moments["m10"], moments["m01"]]) / area
    spread = np.array([[moments["mu20"], moments["mu11"]], [moments["mu11"], moments["mu02"]]]) / area
    direction = np.linalg.eigh(spread)[1][:, 1]
    along = (hull_px - centre) @ direction
    across = (hull_px - centre) @ (-direction[1], direction[0])
    length, width = (float(np.ptp(places)) for places in (along, across))
    if not 2 * RADIUS_RANGE_PX[0] <= width <= 2 * RADIUS_RANGE_PX[1] or length < LEAST_LENGTH * width:
        return None
    if area < LEAST_FILL * (width * (length - width) + math.pi * width**2 / 4):
        return None
    middle_us = begin_us + EXPOSURE_US / 2 - LATENCY_US
    return _Blob(middle_us, centre, direction, length - width, width / 2 - OUTSIDE_PX)


def _goes_on(flight: list[_Blob], blob: _Blob) -> bool:
    """Whether a blob is where the last one of a flight goes on to: by what it travelled in its exposure, either way."""
    last = flight[-1]
    dt_us = blob.t_us - last.t_us
    if not 0 < dt_us <= 2 * STEP_US:
        return False
    step = last.travelled_px * dt_us / EXPOSURE_US * last.direction
    if len(flight) > 1 and step @ (last.centre - flight[-2].centre) < 0:
        step = -step
    ways = (step,) if len(flight) > 1 else (step, -step)
    away = min(float(np.linalg.norm(blob.centre - last.centre - way)) for way in ways)
    return away < LINK_RADII * last.radius_px
