"""Logos printed on the ball, drawn in millimetres on its surface.

A logo is drawn in a plane that touches the ball at the logo's centre: the point at (a, b) mm lies at the
surface distance hypot(a, b) from the centre (azimuthal equidistant, so strokes keep their width). In the
ball's own frame the centre is +z, a runs along +x and b along +y (seen from outside: a to the right, b
upwards). For the kernels it is resampled onto the Lambert azimuthal equal-area map (u, w) = (x, y) sqrt(2 /
(1 + z)), which needs no arc cosine.
"""

from __future__ import annotations

import base64
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import ParameterError
from ..files import file_bytes

Floats = NDArray[np.float64]
Drawing = Callable[[Floats, Floats], Floats]  # (a, b) in mm -> distance to the print in mm, negative inside

TEXEL_MM = 0.06  # a tenth of the thinnest stroke (0.6 mm)
PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
MAX_PNG_BYTES = 32 << 20  # more than such a picture takes unpacked
MAX_PNG_SIDE_PX = 2048  # 60 mm, the widest logo, in steps of half a texel
RADIUS_MM = 20.0  # logos are drawn for the 40 mm ball


@dataclass(frozen=True)
class Logo:
    """Logo of a ball: one of `NAMES`, or "png" with the file's bytes and the width on the ball."""

    name: str = "andro"
    png_base64: str = ""
    width_mm: float = 24.0
    sides: int = 1  # 2 = the same again on the other side of the ball

    def __post_init__(self) -> None:
        if self.name not in (*NAMES, "png"):
            raise ParameterError(f"logo {self.name!r} is unknown: there are {', '.join(NAMES)}, or a PNG file")
        if not 1.0 <= self.width_mm <= 60.0:
            raise ParameterError(f"logo width {self.width_mm:g} mm is out of range: 1 to 60 mm")
        if self.sides not in (1, 2):
            raise ParameterError(f"logo on {self.sides} sides: 1 or 2 are possible")

    @classmethod
    def of(cls, name_or_png: str | Logo) -> Logo:
        """A logo by name or from a PNG file (dark = print, transparent = none), or itself; raises ParameterError."""
        if isinstance(name_or_png, Logo):
            return name_or_png
        if not name_or_png.lower().endswith(".png"):
            return cls(name_or_png)
        try:
            content = file_bytes(Path(name_or_png), MAX_PNG_BYTES)
        except OSError as error:
            raise ParameterError(f"the logo cannot be read ({error.strerror}): {name_or_png}") from error
        logo = cls("png", base64.b64encode(content).decode("ascii"))
        _png_darkness(logo.png_base64)
        return logo


@dataclass(frozen=True, eq=False)
class Texture:
    """Printing on the Lambert azimuthal equal-area map."""

    values: NDArray[np.float32]  # (n, n), 0 = ball, 1 = print; row = w, column = u
    half_extent: float  # half side of the map in (u, w)
    cap_rad: float  # angle from the logo's centre beyond which nothing is printed
    extent_u: float  # largest |u| and |w| with printing
    extent_w: float


@lru_cache(maxsize=8)
def texture(logo: Logo, blur_mm: float = 0.0) -> Texture:
    """The logo's texture, softened by a Gaussian of this sigma (the isotropic part of the optics')."""
    drawing, reach_mm = _drawing(logo)
    cap_rad = min((reach_mm + 3 * blur_mm + 2 * TEXEL_MM) / RADIUS_MM, np.pi * 0.99)
    half_extent = 2 * np.sin(cap_rad / 2)
    size = int(np.ceil(2 * half_extent * RADIUS_MM / TEXEL_MM)) + 1
    axis = np.linspace(-half_extent, half_extent, size)
    u, w = np.meshgrid(axis, axis)
    rho = np.hypot(u, w)
    angle = 2 * np.arcsin(np.minimum(rho / 2, 1.0))
    stretch = np.divide(angle * RADIUS_MM, rho, out=np.full_like(rho, RADIUS_MM), where=rho > 0)
    values = np.clip(0.5 - drawing(u * stretch, w * stretch) / TEXEL_MM, 0.0, 1.0)
    if blur_mm > 0:
        from scipy.ndimage import gaussian_filter  # a quarter of a second to load, needed here only

        values = gaussian_filter(values, blur_mm / TEXEL_MM, mode="constant")
    values[angle > cap_rad] = 0.0
    printed = values > 1e-4
    return Texture(
        np.ascontiguousarray(values, np.float32),
        float(half_extent),
        float(cap_rad),
        float(np.max(np.abs(u), where=printed, initial=0.0)),
        float(np.max(np.abs(w), where=printed, initial=0.0)),
    )


def _stroke(a: Floats, b: Floats, start: tuple[float, float], end: tuple[float, float]) -> Floats:
    """Distance to a straight stroke's middle line."""
    along_a, along_b = end[0] - start[0], end[1] - start[1]
    share = ((a - start[0]) * along_a + (b - start[1]) * along_b) / (along_a**2 + along_b**2)
    share = np.clip(share, 0.0, 1.0)
    return np.hypot(a - start[0] - share * along_a, b - start[1] - share * along_b)


def _ring(a: Floats, b: Floats, centre: tuple[float, float], half: tuple[float, float]) -> Floats:
    """Distance to an ellipse's line, to first order."""
    x, y = (a - centre[0]) / half[0], (b - centre[1]) / half[1]
    radius = np.maximum(np.hypot(x, y), 1e-9)
    slope = np.hypot(x / half[0], y / half[1]) / radius
    return np.asarray(np.abs(radius - 1) / np.maximum(slope, 1e-9))


def _wordmark(a: Floats, b: Floats) -> Floats:
    """A word of five bold letters (A N D R O), 24 mm long and 6.2 mm high, strokes of 1.4 mm."""
    top, base, half = 2.4, -2.4, 0.7
    strokes = (
        *(((-11.3, base), (-9.5, top)), ((-9.5, top), (-7.7, base)), ((-10.5, -1.0), (-8.5, -1.0))),  # A
        *(((-5.6, base), (-5.6, top)), ((-5.6, top), (-2.6, base)), ((-2.6, base), (-2.6, top))),  # N
        ((-0.4, base), (-0.4, top)),  # D
        *(((4.4, base), (4.4, top)), ((5.5, -0.2), (6.7, base))),  # R
    )
    lines = [_stroke(a, b, start, end) for start, end in strokes]
    lines.append(np.where(a >= -0.4, _ring(a, b, (-0.4, 0.0), (2.7, 2.4)), np.inf))
    lines.append(np.where(a >= 4.4, _ring(a, b, (4.4, 1.1), (2.1, 1.3)), np.inf))
    lines.append(_ring(a, b, (9.9, 0.0), (1.7, 2.4)))  # O
    return np.asarray(np.minimum.reduce(lines) - half)


def _line(width_mm: float) -> Drawing:
    return lambda a, b: _stroke(a, b, (-13.0, 0.0), (13.0, 0.0)) - width_mm / 2


def _double_circle(a: Floats, b: Floats) -> Floats:
    """Two thin circles, lines of 0.6 mm (the paper's logo 2: too thin to see in flight)."""
    radius = np.hypot(a, b)
    return np.minimum(np.abs(radius - 8.0), np.abs(radius - 6.0)) - 0.3


def _seam(a: Floats, b: Floats) -> Floats:
    """The seam of a ball made of two halves: a great circle 0.4 mm wide (our reading of photographs)."""
    return np.abs(np.hypot(a, b) - np.pi / 2 * RADIUS_MM) - 0.2


# Middles (a, b) and radii of spots of dirt in mm, as of a ball that was played with: our choice.
SPOTS_MM = ((0.0, 0.0, 0.9), (14.0, 6.0, 0.7), (-9.0, 16.0, 1.1), (-20.0, -8.0, 0.6), (11.0, -19.0, 0.8))


def _marks(a: Floats, b: Floats) -> Floats:
    """Spots of dirt, no print."""
    return np.asarray(np.minimum.reduce([np.hypot(a - x, b - y) - radius for x, y, radius in SPOTS_MM]))


_DRAWINGS: dict[str, tuple[Drawing, float]] = {
    "andro": (_wordmark, 12.6),
    "double_circle": (_double_circle, 8.3),
    "line_0.8mm": (_line(0.8), 13.4),
    "line_1.4mm": (_line(1.4), 13.7),
    "seam": (_seam, 31.8),
    "marks": (_marks, 23.0),
    "none": (lambda a, b: np.full_like(a, np.inf), 1.0),
}
NAMES = tuple(_DRAWINGS)


def _drawing(logo: Logo) -> tuple[Drawing, float]:
    if logo.name != "png":
        return _DRAWINGS[logo.name]
    dark = _png_darkness(logo.png_base64)
    height, width = dark.shape
    pitch = logo.width_mm / width

    def sampled(a: Floats, b: Floats) -> Floats:
        column, row = a / pitch + (width - 1) / 2, (height - 1) / 2 - b / pitch
        inside = (column >= 0) & (column <= width - 1) & (row >= 0) & (row <= height - 1)
        row, column = (np.clip(np.rint(v), 0, n - 1).astype(np.intp) for v, n in ((row, height), (column, width)))
        return (0.5 - np.where(inside, dark[row, column], 0.0)) * TEXEL_MM

    return sampled, 0.5 * pitch * float(np.hypot(width, height))


def _png_darkness(png_base64: str) -> Floats:
    """(h, w) float64, 0 = blank, 1 = print; raises ParameterError when it is no PNG."""
    import cv2  # only for pictures of one's own; 60 ms to load

    content = base64.b64decode(png_base64)
    if not content.startswith(PNG_SIGNATURE):
        raise ParameterError("the logo is no PNG picture that can be read")
    width, height = (int.from_bytes(content[place : place + 4]) for place in (16, 20))  # stated in every PNG's head
    if max(width, height) > MAX_PNG_SIDE_PX:
        raise ParameterError(
            f"the logo's picture has {width} x {height} pixels: make it smaller, {MAX_PNG_SIDE_PX} each way at most"
        )
    image = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise ParameterError("the logo is no PNG picture that can be read")
    picture = image.astype(np.float64) / (65535.0 if image.dtype == np.uint16 else 255.0)
    if picture.ndim == 2:
        return 1.0 - picture
    dark = 1.0 - picture[..., :3].mean(axis=2)
    return np.asarray(dark * picture[..., 3] if picture.shape[2] == 4 else dark)
