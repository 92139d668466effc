"""Views of a calibration board on a blinking screen: its corners in the image of each flash."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import ParameterError, RecordingError
from ..events import EventBatch
from ..recordings import Recording
from ..recordings.in_memory import RecordingInMemory

Floats = NDArray[np.float64]
Pattern = Literal["chessboard", "charuco"]

BIN_US = 1000
# A flash: milliseconds with at least so many times the median's ON events, and so many pixels' worth of them.
FLASH_RATIO, FLASH_SHARE = 5.0, 0.005
QUIET_BINS = 5  # milliseconds without, before a new flash begins: an LCD takes some to turn bright
FLASH_US = 15_000  # what belongs to a flash: three response times of a slow LCD
MOST_FLASHES = 120  # looked at, evenly spread: a tenth of a second each
DIFFERENT_SHARE = 0.02  # of the image's width, by which a corner moves at least between two views that are kept
BLUR_PX = 0.8  # joins pixels to edges that can be fitted
# A flash begins when this share of its pixels has responded. A pixel that responds so much later is darker by e: a
# fraction of the response of an LCD. 150 us does as well.
BEGIN_SHARE, DECAY_US = 0.02, 500.0
# Fit of a corner: pixels within so much of a square, an edge of this width (pixel and BLUR_PX), rounds of Gauss-Newton,
# and how far OpenCV's corner may be off.
WINDOW, EDGE_PX, ROUNDS, FARTHEST_PX = 0.8, 1.2, 4, 1.5
MARKER_SHARE = 0.75  # side of a ChArUco marker over that of its square, OpenCV's usual value


@dataclass(frozen=True)
class Board:
    """A chessboard, or a ChArUco board, whose white squares blink.

    Attributes
    ----------
    columns, rows : int
        Inner corners, as OpenCV counts them.
    square_mm : float
        Side of a square.
    pattern : str
        "chessboard", seen as a whole, or "charuco" (4 x 4 markers, dictionary of 250), of which a part is enough.
    """

    columns: int
    rows: int
    square_mm: float
    pattern: Pattern = "chessboard"

    def __post_init__(self) -> None:
        if not (3 <= self.columns <= 100 and 3 <= self.rows <= 100):
            raise ParameterError(f"a board of {self.columns}x{self.rows} inner corners is none: 3 to 100 each")
        if not 0.1 <= self.square_mm <= 10_000:
            raise ParameterError(f"squares of {self.square_mm:g} mm are none: give their side in mm, 0.1 to 10000")

    @property
    def corners_mm(self) -> Floats:
        """(rows * columns, 3) float64 inner corners on the board, row by row, z = 0."""
        column, row = np.meshgrid(np.arange(self.columns), np.arange(self.rows))
        places = np.column_stack([column.ravel(), row.ravel(), np.zeros(column.size)])
        return places.astype(np.float64) * self.square_mm

    def find(self, image: NDArray[np.uint8]) -> tuple[NDArray[np.int64], Floats] | None:
        """Numbers (k,) of the corners in an image and their pixels (k, 2); None where the board is not seen."""
        import cv2

        if self.pattern == "charuco":
            corners, numbers, _, _ = cv2.aruco.CharucoDetector(self.charuco()).detectBoard(image)
            if numbers is None or len(numbers) < 6:  # a pose has six unknowns, a corner gives two
                return None
            return numbers.ravel().astype(np.int64), corners.reshape(-1, 2).astype(np.float64)
        flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ACCURACY
        found, corners = cv2.findChessboardCornersSB(image, (self.columns, self.rows), flags=flags)
        if not found:
            return None
        numbers = np.arange(self.columns * self.rows)
        return numbers, self._refined(image, corners.reshape(-1, 2).astype(np.float64))

    def _refined(self, image: NDArray[np.uint8], corners_px: Floats) -> Floats:
        """(n, 2) corners of all of a chessboard, each fitted to the pixels around it.

        The model of a corner is bright + contrast erf(u / sigma) erf(v / sigma), with u and v the distances from it
        along the board's two directions, as the neighbours tell them. In simulated flashes these corners are off by
        0.04 px (root mean square of the median view of seed 91007).
        """
        from scipy.special import erf

        grid = corners_px.reshape(self.rows, self.columns, 2)
        along, down = (np.asarray(np.gradient(grid, axis=axis), np.float64) for axis in (1, 0))  # px a square
        refined = grid.copy()
        for row, column in np.ndindex(self.rows, self.columns):
            to_square = np.linalg.inv(np.column_stack([along[row, column], down[row, column]]))
            sigma = EDGE_PX * math.sqrt(abs(np.linalg.det(to_square)))
            reach = math.ceil(WINDOW * float(np.abs([along[row, column], down[row, column]]).sum(axis=0).max()))
            middle = np.round(grid[row, column]).astype(int)
            y0, x0 = max(middle[1] - reach, 0), max(middle[0] - reach, 0)
            part = image[y0 : middle[1] + reach + 1, x0 : middle[0] + reach + 1].astype(np.float64)
            y, x = np.mgrid[y0 : y0 + part.shape[0], x0 : x0 + part.shape[1]].reshape(2, -1)
            for _ in range(ROUNDS):
                u, v = to_square @ (np.stack([x, y]) - refined[row, column][:, None])
                near = np.maximum(np.abs(u), np.abs(v)) < WINDOW
                u, v, seen = u[near] / sigma, v[near] / sigma, part.ravel()[near]
                across, along_v = erf(u), erf(v)
                slope_u, slope_v = np.exp(-(u**2)) * along_v, np.exp(-(v**2)) * across
                design = np.column_stack([np.ones(u.size), across * along_v, slope_u, slope_v])
                fitted = np.linalg.lstsq(design, seen, rcond=None)[0]
                # d erf(u / sigma) / d place = -2 / (sqrt(pi) sigma) exp(-u^2 / sigma^2)
                step = -fitted[2:] / fitted[1] * sigma * math.sqrt(math.pi) / 2
                refined[row, column] += np.linalg.solve(to_square, np.clip(step, -0.1, 0.1))
        away = np.linalg.norm(refined - grid, axis=2)
        return np.where(away[..., None] < FARTHEST_PX, refined, grid).reshape(-1, 2)

    def charuco(self) -> Any:
        """OpenCV's board of this pattern."""
        import cv2

        markers = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_250)
        size = (self.columns + 1, self.rows + 1)
        return cv2.aruco.CharucoBoard(size, self.square_mm, MARKER_SHARE * self.square_mm, markers)


@dataclass(frozen=True, eq=False)
class BoardView:
    """Corners of the board at one flash.

    Attributes
    ----------
    t_us : int
        Begin of the flash, file time.
    numbers : (k,) int64
        Of the corners on the board.
    corners_px : (k, 2) float64
    """

    t_us: int
    numbers: NDArray[np.int64]
    corners_px: Floats


def board_views(recording: Recording | RecordingInMemory, board: Board) -> list[BoardView]:
    """The different views of a blinking board in a recording; raises RecordingError where it is never seen."""
    events = recording.read()
    size = recording.height_px, recording.width_px
    begins_us = flash_times_us(events, size[0] * size[1])
    if not begins_us.size:
        raise RecordingError(
            "nothing flashes in the recording: let the screen with the board blink, some 2 to 10 times a second, and "
            f"fill a part of the image with it: {recording.path}"
        )
    chosen = begins_us[np.unique(np.linspace(0, begins_us.size - 1, MOST_FLASHES).round().astype(int))]
    views: list[BoardView] = []
    for t_us in chosen:
        found = board.find(flash_image(events.between(int(t_us), int(t_us) + FLASH_US), size))
        if found is not None:
            view = BoardView(int(t_us), *found)
            if all(_differ(view, other, DIFFERENT_SHARE * size[1]) for other in views):
                views.append(view)
    if not views:
        raise RecordingError(
            f"the board of {board.columns}x{board.rows} inner corners ({board.pattern}) is seen in none of "
            f"{chosen.size} flashes: check --board and its white margin, and keep the whole board in view: "
            f"{recording.path}"
        )
    return views


def flash_times_us(events: EventBatch, pixels: int) -> NDArray[np.int64]:
    """(n,) int64 begins of the flashes, file time: bursts of ON events after a quiet time."""
    on_us = events.t_us[events.on]
    if not on_us.size:
        return np.empty(0, np.int64)
    first_us = int(on_us[0])
    counts = np.bincount((on_us - first_us) // BIN_US)
    least = max(FLASH_RATIO * float(np.median(counts)), FLASH_SHARE * pixels / (FLASH_US / BIN_US))
    bright = np.flatnonzero(counts >= least)
    begins = bright[np.diff(bright, prepend=-QUIET_BINS - 1) > QUIET_BINS]
    return first_us + begins.astype(np.int64) * BIN_US


def flash_image(events: EventBatch, size: tuple[int, int]) -> NDArray[np.uint8]:
    """(height, width) uint8 image of a flash: what turns bright is bright, the more the sooner.

    The screen turns bright gradually, so that a pixel's first ON event comes the later the less white the pixel sees.
    Its time tells the place of an edge to a part of a pixel, which the number of events does not where pixels respond
    once a flash.
    """
    import cv2

    on = np.flatnonzero(events.on)[::-1]  # the first event of a pixel is the last to be written
    after_us = np.full(size, np.inf)
    after_us[events.y_px[on], events.x_px[on]] = events.t_us[on]
    seen = np.isfinite(after_us)
    if seen.any():
        after_us -= np.quantile(after_us[seen], BEGIN_SHARE)
    bright = 255 * np.exp(-np.maximum(after_us, 0.0) / DECAY_US)
    return np.asarray(cv2.GaussianBlur(bright.astype(np.float32), (0, 0), BLUR_PX).astype(np.uint8))


def _differ(view: BoardView, other: BoardView, least_px: float) -> bool:
    """Whether corners of two views lie apart by so much on average, or other ones are seen."""
    _, mine, its = np.intersect1d(view.numbers, other.numbers, return_indices=True)
    if mine.size < max(view.numbers.size, other.numbers.size) / 2:
        return True
    away = np.linalg.norm(view.corners_px[mine] - other.corners_px[its], axis=1)
    return float(away.mean()) >= least_px


def corners_of(views: Sequence[BoardView], board: Board) -> Iterator[tuple[Floats, Floats]]:
    """Corners of each view: (k, 3) on the board in mm, and (k, 2) in pixels."""
    corners_mm = board.corners_mm
    for view in views:
        yield corners_mm[view.numbers], view.corners_px
