"""The clock of everything live."""

from time import monotonic as now_s

__all__ = ["now_s"]
