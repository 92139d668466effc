"""Contrast maximisation on the sphere: the spin whose derotated logo events are sharpest, with its uncertainty.

Notes
-----
Not in the paper; it takes the place of the averaged flow of section 3.3. `stage` runs the method tick by tick and says
what speaks against an answer; `events` holds what goes in and comes out, `score` the objective, `search` its
maximisation (over a grid of all spins, then by Newton's method) and the covariance at a maximum, `estimate` the order
of these steps, the aliases of whole turns, and the spins of a flight's two ends.
"""

from .events import ContrastResult as ContrastResult
from .stage import STAGE as STAGE
from .stage import ContrastParameters as ContrastParameters
