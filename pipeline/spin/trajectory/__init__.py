"""The spin that bends the flight: gravity, drag and Magnus lift fitted to the tracked circles.

Notes
-----
Not in the paper. `motion` fits the flight, `likelihood` says which spins bend it like that, `stage` runs both tick by
tick, `calibration` finds what the flights of one set-up share: lift, drag and plumb line.

References
----------
Tamaki et al. 2024 combine logo and trajectory; Achterhold et al. 2023 infer spin from trajectories of frame cameras,
whose positions are good to 2-3 mm; an event camera's are good to 0.1 mm.
"""

from .stage import STAGE as STAGE
