"""The errors that Spinscope raises on purpose; each message says what is wrong and what to do about it."""


class SpinscopeError(Exception):
    """Anything the user can put right; shown as one line, never as a traceback."""


class ParameterError(SpinscopeError):
    """A parameter is unknown, of the wrong kind or out of its range."""


class RecordingError(SpinscopeError):
    """A recording cannot be read or holds nothing that can be used."""


class CameraError(SpinscopeError):
    """A running camera cannot be found, opened, set or read."""
