"""The five biases of Prophesee's IMX636 (EVK4), a model of their physical units, and the files that state them.

The biases are offsets from the factory setting (0). The maker publishes their direction and their range, not
what they are in per cent, hertz or microseconds. `CURVES` is therefore a model: monotone, in one place,
marked as not calibrated, to be replaced by one's own measurements (`SensorModel.of(biases, curves)`).
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .errors import ParameterError, RecordingError
from .files import atomic_file
from .parameters import ParameterGroup, tunable


@dataclass(frozen=True, kw_only=True)
class BiasParameters(ParameterGroup):
    """Offsets in `.bias` units; ranges are the maker's for the IMX636, defaults the paper's (supplement)."""

    diff_on: int = tunable(40, -85, 140, 1, "", "contrast threshold of ON events; higher = fewer events")
    diff_off: int = tunable(40, -35, 190, 1, "", "contrast threshold of OFF events; higher = fewer events")
    fo: int = tunable(55, -35, 55, 1, "", "cut-off of the pixel's low-pass; higher = faster pixels")
    hpf: int = tunable(0, 0, 120, 1, "", "cut-off of the pixel's high-pass; higher = slow motion vanishes")
    refr: int = tunable(80, -20, 235, 1, "", "refractory period; higher = shorter dead time, more events")


LARGEST_BYTES = 1 << 20  # of a file of biases; real ones have some hundred bytes, camera settings a few thousand

PAPER = BiasParameters()
FACTORY = BiasParameters(diff_on=0, diff_off=0, fo=0, hpf=0, refr=0)


@dataclass(frozen=True, slots=True)
class BiasCurve:
    """Physical quantity as a function of one bias: linear interpolation in the logarithm of the quantity.

    Attributes
    ----------
    bias : str
        Field of BiasParameters.
    points : tuple of (float, float)
        Bias value, rising over the whole range, and quantity > 0, monotone. A quantity may be 0 at one end; then it is
        interpolated itself.
    calibrated : bool
        Whether the points were measured.
    """

    bias: str
    points: tuple[tuple[float, float], ...]
    calibrated: bool = False

    def at(self, value: float) -> float:
        """Interpolate the quantity at a bias value; outside the points it is that of the nearest end."""
        bias, quantity = np.array(self.points).T
        if not np.all(quantity > 0):  # a quantity that can be switched off goes linearly
            return float(np.interp(value, bias, quantity))
        return float(np.exp(np.interp(value, bias, np.log(quantity))))


# Quantities by name, with the reasons for the model's points; factors are on the noise rate, 1 at the paper's biases.
CURVES = {
    # 25 % nominal contrast (log 0.22) near the factory setting; the supplement's ball keeps its outline and loses
    # most of the logo at 140.
    "threshold_on": BiasCurve("diff_on", ((-85, 0.10), (0, 0.19), (40, 0.27), (60, 0.33), (140, 0.62))),
    # As threshold_on from 0 to 60; steeper above, where the supplement sees the ball's ON and OFF events part
    # (which of them gets rarer is our choice).
    "threshold_off": BiasCurve(
        "diff_off", ((-35, 0.14), (0, 0.19), (40, 0.27), (60, 0.33), (90, 0.55), (140, 1.50), (190, 1.90))
    ),
    # The supplement: only values below 0 change the ball's event rate, there late events of the edge lie inside
    # the ball; the lowest setting is in use against lamps that flicker with 100 Hz.
    "cutoff_hz": BiasCurve("fo", ((-35, 60.0), (-20, 120.0), (-10, 400.0), (0, 3000.0), (55, 8000.0))),
    # 0 filters nothing that matters (supplement), above it slow motion fades first.
    "highpass_hz": BiasCurve("hpf", ((0, 0.0), (20, 5.0), (60, 40.0), (120, 300.0))),
    # The supplement: at 80 a pixel is free again when a 6,000 px/s edge has left it (170 us).
    "refractory_us": BiasCurve("refr", ((-20, 900.0), (0, 450.0), (80, 150.0), (120, 90.0), (235, 20.0))),
    # The supplement: noise falls steeply to an acceptable level at 40, little above.
    "noise_on_factor": BiasCurve("diff_on", ((-85, 300.0), (0, 6.0), (40, 1.0), (140, 0.15))),
    "noise_off_factor": BiasCurve("diff_off", ((-35, 40.0), (0, 6.0), (40, 1.0), (190, 0.1))),
    # A lower cut-off lets less noise through; flat above 0 (supplement).
    "noise_bandwidth_factor": BiasCurve("fo", ((-35, 0.3), (0, 0.9), (55, 1.0))),
    # A high-pass takes slow noise and leak away.
    "noise_highpass_factor": BiasCurve("hpf", ((0, 1.0), (60, 0.4), (120, 0.1))),
    # The supplement: noise keeps rising above 80, ON more than OFF.
    "noise_refractory_factor": BiasCurve("refr", ((-20, 0.6), (0, 0.75), (80, 1.0), (120, 1.6), (235, 6.0))),
}


def read_biases(path: Path | str) -> BiasParameters:
    """Read a file of biases as offsets of the IMX636; a missing bias counts as 0.

    Raises RecordingError for a file that cannot be read or of another form, ParameterError for a bias that is unknown
    or out of range, as those of other sensors are. `bias_diff`, the reference of both thresholds, is 0 on an IMX636.
    """
    values, known = read_bias_values(path), BiasParameters.tunables()
    what = [f"bias_{name} is unknown" for name in sorted(values.keys() - {"diff", *known})]
    if values.get("diff"):
        what.append(f"bias_diff = {values['diff']} is out of range (0)")
    for name, one in known.items():
        if not (one.low or 0) <= values.get(name, 0) <= (one.high or 0):
            what.append(f"bias_{name} = {values[name]} is out of range ({one.allowed})")
    if what:
        raise ParameterError(
            f"the biases are not those of an IMX636 (EVK4): {', '.join(what)}. Older sensors and the GenX320 state "
            f"absolute values, not the offsets {', '.join(f'bias_{name}' for name in known)}: {path}"
        )
    return BiasParameters(**{name: values.get(name, 0) for name in known})


def read_bias_values(path: Path | str) -> dict[str, int]:
    """Read the biases of any sensor from a `.bias` file or the JSON of a camera's settings, told by the content.

    A `.bias` file has one `value % bias_name` a line, with units or ranges after another %; lines that begin with %
    are comments. The JSON of camera settings lists them as `ll_biases_state.bias`, where a value of 0 may be missing.

    Returns
    -------
    dict of str to int
        By name without `bias_`, as the file states them.

    Raises
    ------
    RecordingError
        The file cannot be read, is of another form, or states no bias or one twice.
    """
    try:
        with open(path, "rb") as file:
            content = file.read(LARGEST_BYTES + 1)
    except OSError as error:
        raise RecordingError(f"the bias file cannot be read ({error.strerror}): {path}") from error
    if len(content) > LARGEST_BYTES:
        raise RecordingError(f"the file is larger than {LARGEST_BYTES >> 20} MB, as no bias file is: {path}")
    text = content.decode("utf-8-sig", errors="replace")  # only comments hold more than ASCII
    try:
        pairs = _settings_biases(text) if text.lstrip().startswith("{") else _bias_lines(text)
    except ValueError as error:
        raise RecordingError(f"{error}: {path}") from None
    names = [name for name, _ in pairs]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise RecordingError(f"bias_{twice[0]} is stated twice: {path}")
    if not names:
        raise RecordingError(f"the file states no bias, like `40 % bias_diff_on`: {path}")
    return dict(pairs)


def _bias_lines(text: str) -> list[tuple[str, int]]:
    pairs = []
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip() or line.lstrip().startswith("%"):
            continue
        value, _, rest = line.partition("%")
        name = rest.partition("%")[0].split()
        try:
            pairs.append((name[0].removeprefix("bias_"), int(value, 16 if "x" in value.lower() else 10)))
        except (ValueError, IndexError):
            raise ValueError(f"line {number} is {line.strip()[:80]!r}, not `value % bias_name`") from None
    return pairs


def _settings_biases(text: str) -> list[tuple[str, int]]:
    try:
        listed = json.loads(text)["ll_biases_state"]["bias"]
        return [(str(one["name"]).removeprefix("bias_"), int(one.get("value", 0))) for one in listed]
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
        raise ValueError("the JSON is no camera settings with `ll_biases_state`") from None


def write_biases(biases: BiasParameters, path: Path | str) -> None:
    """Write a `.bias` file; raises RecordingError when it cannot be written."""
    lines = [f"{value} % bias_{name}\n" for name, value in biases.as_dict().items()]
    with atomic_file(path, "bias file") as part:
        part.write_text("".join(lines), encoding="utf-8")
