"""Contrast maximisation on the sphere: the spin whose derotation makes the logo sharpest, with its uncertainty."""

from .stage import STAGE as STAGE
