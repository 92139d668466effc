"""Running cameras: drivers, a recording and a simulated scene in their place, the stream of ticks, and the recorder.

A clock is read here, so that stages and chain need none.
"""

from .drivers import neuromorphic as _neuromorphic  # noqa: F401, I001  registers itself, before those beside it
from .drivers import inivation as _inivation  # noqa: F401  registers itself
from .event_camera import DRIVERS as DRIVERS
from .event_camera import CameraDriver as CameraDriver
from .event_camera import CameraOptions as CameraOptions
from .event_camera import CameraPacket as CameraPacket
from .event_camera import EventCamera as EventCamera
from .event_camera import ListedCamera as ListedCamera
from .event_camera import open_camera as open_camera
from .event_stream import ArrivedTick as ArrivedTick
from .event_stream import EventStream as EventStream
from .event_stream import Notice as Notice
from .event_stream import NoticeKind as NoticeKind
from .recent_events import RecentEvents as RecentEvents
from .recorder import Recorder as Recorder
from .replay import FAULTS as FAULTS
from .replay import ReplayCamera as ReplayCamera
from .simulated import SimulatedCamera as SimulatedCamera
