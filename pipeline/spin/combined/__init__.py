"""Combined: one spin from the logo's pattern, motion, rhythm and sightings, and the bend of the flight.

Notes
-----
Not in the paper. Contrast names the spins that explain the logo; where it names none, the rhythm's magnitudes about the
flight's axis stand in, and without a rhythm the spins that bend the flight. Each of these `candidates` is weighed by
the `likelihoods` of all other witnesses, which also narrow its error; `stage` does so tick by tick and says whether the
answer is to be trusted. A witness that may be wrong altogether says so in its likelihood: a mixture of what it measures
and of a blunder, so that none of them alone can exclude what all others say.
"""

from .stage import STAGE as STAGE
