"""Methods of other publications, for comparison: run only when they are named, and never trusted.

Each is written anew from its publication; its module says from which, and what deviates.
"""

from . import eeppr, logo_orientation, s_cmax, slice_flow

STAGES = (
    s_cmax.OFFLINE,
    s_cmax.ONLINE,
    slice_flow.LUCAS_KANADE,
    slice_flow.PLANES,
    slice_flow.TIME_SURFACES,
    eeppr.EEPPR,
    logo_orientation.LOGO_ORIENTATION,
)
