"""Where everything stands in the viewer, and in which colour: one place for both."""

from __future__ import annotations

Colour = tuple[int, int, int]

APPLICATION = "spinscope"
TIMELINE = "t"

# The image plane: pixels as in the recording, origin at the centre of the top-left pixel.
IMAGE = "/image"
FRAME = "/image/frame"
EVENTS = "/image/events"
SURFACE = "/image/surface"
HOUGH = "/image/hough"
MEASURED = "/image/measured"
KALMAN = "/image/kalman"
TRUE_CIRCLE = "/image/truth"
# Children of the ball move with it: pixels from its centre.
BALL_PLACE = "/image/ball"
BALL_CENTRE = "/image/ball/centre"
LOGO = "/image/ball/logo"
LOGO_OUTLINE = "/image/ball/outline"
LOGO_MASK = "/image/ball/mask"
FLOW = "/image/ball/flow"
FLOW_WHEEL = "/image/ball/wheel"
STILL_LOGO = "/still_logo"
UNROLLED = "/unrolled"
GRATICULE = "/unrolled/graticule"
# The score of contrast, over magnitudes and over directions of the axis.
SCORE_MAGNITUDE = "/score"
SCORE_AXES = "/score_axes"

# Plots.
STATUS = "/tracker"
QUANTITIES = ("x", "y", "vx", "vy", "radius")
UNITS = ("px", "px", "px/s", "px/s", "px")
PLOT = "/plots"
RESIDUAL = "/plots/residual"
EVENT_COUNT = "/plots/events"
RATE = "/plots/rate"
RHYTHM = "/plots/rhythm"
SPIN_MAGNITUDE = "/plots/spin"
SPIN_PARTS = "/plots/spin_parts"
AXIS_ERROR = "/plots/axis_error"

# Space: the camera frame, metres.
WORLD = "/world"
PATH = "/world/path"
TRUE_PATH = "/world/true_path"
AXES = "/world/axes"
BALL = "/world/ball"
BODY = "/world/ball/body"
MESH = "/world/ball/body/mesh"
SPIN_ARROWS = "/world/ball/spin"
SPIN_SHOWN = "/world/ball/shown"
SPIN_RING = "/world/ball/ring"
RING_TIP = "/world/ball/ring/tip"

# Words.
SUMMARY = "/summary"
COACH = "/coach"

ON: Colour = (239, 83, 80)
OFF: Colour = (66, 145, 245)
ON_REMOVED: Colour = (122, 62, 60)
OFF_REMOVED: Colour = (44, 77, 122)
HOUGH_COLOUR: Colour = (255, 213, 79)
MEASURED_COLOUR: Colour = (255, 138, 50)
KALMAN_COLOUR: Colour = (76, 217, 100)
TRUTH_COLOUR: Colour = (214, 120, 255)
MASK_COLOUR: Colour = (130, 140, 150)
PATH_COLOUR: Colour = (76, 217, 100)
RING_COLOUR: Colour = (255, 213, 79)
BACKGROUND: Colour = (16, 16, 16)
METHOD_COLOURS: dict[str, Colour] = {
    "triplet": (255, 167, 38),
    "normal_flow": (38, 198, 218),
    "contrast": (236, 64, 122),
}
RATE_COLOUR: Colour = (174, 213, 129)
STATUS_COLOURS: dict[str, Colour] = {
    "searching": (96, 105, 115),
    "starting": (255, 202, 40),
    "tracking": (67, 160, 71),
    "coasting": (92, 148, 214),
    "lost": (229, 57, 53),
}
# Classes of the raw events: 2 x (kept by the surface's filter) + (ON).
EVENT_CLASSES: tuple[tuple[str, Colour], ...] = (
    ("OFF, filtered out", OFF_REMOVED),
    ("ON, filtered out", ON_REMOVED),
    ("OFF", OFF),
    ("ON", ON),
)


def method_colour(method: str) -> Colour:
    """The colour of a method's estimates everywhere."""
    return METHOD_COLOURS.get(method, (200, 200, 200))
