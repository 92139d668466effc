"""The numbers of Spinscope: events in, track and spin out. No viewer, no web, no wall clock, no global state."""

__all__: list[str] = []
