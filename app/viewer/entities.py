"""Entity paths of the viewer, and the colours of what stands there."""

from __future__ import annotations

import colorsys

from spinscope.pipeline.shots import BEGAN_WORDS

Colour = tuple[int, int, int]

APPLICATION = "spinscope"
TIMELINE = "t"

# The image plane: pixels as in the recording, origin at the centre of the top-left pixel.
IMAGE = "/image"
FRAME = "/image/frame"
CAMERA_FRAMES = "/image/camera"
EVENTS = "/image/events"
SURFACE = "/image/surface"
HOUGH = "/image/hough"
MEASURED = "/image/measured"
KALMAN = "/image/kalman"
TRUE_CIRCLE = "/image/truth"
CIRCLE_NAMES = "/image/names"
POLARITY_NAMES = "/image/polarities"
# All balls, numbered by their shots.
BALLS = "/image/balls"
TRACKS = "/image/tracks"
# Children of the ball move with it: pixels from its centre.
BALL_PLACE = "/image/ball"
BALL_CENTRE = "/image/ball/centre"
LOGO = "/image/ball/logo"
LOGO_OUTLINE = "/image/ball/outline"
LOGO_MASK = "/image/ball/mask"
FLOW = "/image/ball/flow"
FLOW_WHEEL = "/image/ball/wheel"
FLOW_SPEED = "/image/ball/wheel/speed"
DEROTATED_LOGO = "/derotated_logo"
UNROLLED = "/unrolled"
GRATICULE = "/unrolled/graticule"
# The score of contrast, over magnitudes and over directions of the axis.
SCORE_MAGNITUDE = "/score"
SCORE_AXES = "/score_axes"
WITNESSES = "/witnesses"

# Over time.
TRACKER = "/tracker"
STATUS = "/tracker/ball"
SHOTS = "/tracker/shots"
CONTACTS = "/contacts"
PLOT = "/plots"
RESIDUAL = "/plots/residual"
EVENT_COUNT = "/plots/events"
RATE = "/plots/rate"
RATE_CROSSINGS = "/plots/rate_crossings"
SPIN_MAGNITUDE = "/plots/spin"
SPIN_COMPONENTS = "/plots/spin_components"
AXIS_ERROR = "/plots/axis_error"

# Space: the camera frame, metres.
WORLD = "/world"
PATH = "/world/path"
PATHS = "/world/paths"
TRUE_PATH = "/world/true_path"
AXES = "/world/axes"
BALL = "/world/ball"
BODY = "/world/ball/body"
MESH = "/world/ball/body/mesh"
SPIN_ARROWS = "/world/ball/spin"
SPIN_SHOWN = "/world/ball/shown"
SPIN_RING = "/world/ball/ring"
RING_TIP = "/world/ball/ring/tip"

# Text.
SUMMARY = "/summary"
COACH = "/coach"
COMPARISON = "/compare"

# Of two runs A and B: their surfaces' difference around the ball, and their axes on a unit sphere.
DIFFERENCE = "/difference"
SURFACE_DIFFERENCE = "/difference/surface"
NO_DIFFERENCE = "/difference/none"
COMPARED_AXES = "/axes"

# Colours of series, of ON and OFF, and of the spin methods are told apart by red-green-blind eyes, too: a test.
ON: Colour = (210, 30, 60)
OFF: Colour = (120, 180, 255)
ON_REMOVED: Colour = (122, 62, 60)
OFF_REMOVED: Colour = (44, 77, 122)
OFF_FLICKER: Colour = (112, 96, 24)
ON_FLICKER: Colour = (168, 148, 44)
HOUGH_COLOUR: Colour = (255, 255, 105)
MEASURED_COLOUR: Colour = (240, 120, 60)
KALMAN_COLOUR: Colour = (15, 225, 120)
TRUTH_COLOUR: Colour = (165, 105, 255)
MASK_COLOUR: Colour = (130, 140, 150)
PATH_COLOUR = KALMAN_COLOUR
OTHERS_COLOUR: Colour = (200, 206, 212)
CONTACT_COLOUR: Colour = (255, 112, 167)
RING_COLOUR: Colour = (255, 213, 79)
DOUBTED_COLOUR: Colour = (150, 143, 122)  # of an answer that is shown and not trusted: the ring's, pale
RATE_COLOUR: Colour = (210, 255, 195)
BACKGROUND: Colour = (16, 16, 16)
STATUS_COLOURS: dict[str, Colour] = {
    "searching": (96, 105, 115),
    "starting": (255, 202, 40),
    "tracking": (67, 160, 71),
    "coasting": (92, 148, 214),
    "lost": (229, 57, 53),
}
SHOT_COLOURS: dict[str, Colour] = {
    "no shot": (60, 66, 72),
    BEGAN_WORDS["start"]: (120, 144, 156),
    BEGAN_WORDS["entered"]: (67, 160, 71),
    BEGAN_WORDS["found"]: (92, 148, 214),
    BEGAN_WORDS["bounce"]: (236, 112, 99),
    BEGAN_WORDS["hit"]: (255, 167, 38),
}
# Classes of the raw events: 4 x (lamp flicker) + 2 x (kept by the surface's filter) + (ON).
EVENT_CLASSES: tuple[tuple[str, Colour], ...] = (
    ("OFF, filtered out", OFF_REMOVED),
    ("ON, filtered out", ON_REMOVED),
    ("OFF", OFF),
    ("ON", ON),
    ("OFF, lamp flicker", OFF_FLICKER),
    ("ON, lamp flicker", ON_FLICKER),
)
HUES_DEG = {"red": 0, "orange": 33, "yellow": 50, "yellow-green": 90, "green": 125, "cyan": 187, "blue": 215}
HUES_DEG |= {"violet": 282, "pink": 335}


def colour_name(colour: Colour) -> str:
    """Name of a colour for captions, by its hue."""
    hue, saturation, _ = colorsys.rgb_to_hsv(*colour)
    if saturation < 0.1:
        return "white"
    hue_deg = 360 * hue
    return min(HUES_DEG, key=lambda name: abs((HUES_DEG[name] - hue_deg + 180) % 360 - 180))
