"""One open recording with its parameters and chain, and the result of running it."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from .camera import Camera, CameraParameters
from .chain import Chain
from .errors import ParameterError
from .presets import preset
from .recordings import ReadingOptions, Recording, open_recording
from .recordings.source import AnyRecording, RecordedEvents, recorded_events
from .registry import STAGES, Parameters, default_stages, methods
from .results import Truth
from .shots import Shot, ShotLog
from .sidecar import GROUPS, Sidecar
from .stages.fixed_ball import find_fixed_ball
from .tick import Tick

SAMPLES = Path(__file__).parents[1] / "sample_recordings"
DEFAULT_SAMPLE = SAMPLES / "flight_fast_top.h5"
SCHEMA = 1
FRAMES_BYTES = 1_500_000_000  # full frames held for the viewer: 8 s of the paper's sensor at 200 Hz
WARM_UP_TICKS = 4  # with flow, until the spin has been solved for and solved again
TICKS_TOGETHER = 4  # ticks that a stage works through at a time: tracking costs a quarter less; more surfaces cost more
FIXED_BALL_US = 10_000_000  # a ball on a spinner is looked for in the first 10 s: hundreds of turns
MARGIN_US = 50_000  # shown before and after a shot of a long recording

Progress = Callable[[float, str], None]  # share done (0..1) and what is being done


@dataclass(frozen=True, slots=True)
class Choices:
    """Options of a session, as the command line gives them.

    Attributes
    ----------
    preset : str or Path, optional
        Name of a preset, or a TOML file.
    assignments : sequence of str
        `group.field=value`, applied in order.
    window_us : (int, int), optional
        [start, end) in file time: only these events are used.
    fixed_ball : (x_px, y_px, radius_px) or "auto", optional
        Circle of a ball spinner's ball.
    reading : ReadingOptions
        Statements about the recording: size of the sensor, dataset, unit of time.
    flight_calibration : str or Path, optional
        TOML file with the calibration of the set-up's flights; it goes before the preset.
    rivals : sequence of str
        Methods of other publications to run besides.
    """

    preset: str | Path | None = None
    assignments: Sequence[str] = ()
    window_us: tuple[int, int] | None = None
    fixed_ball: tuple[float, float, float] | str | None = None
    reading: ReadingOptions = ReadingOptions()
    flight_calibration: str | Path | None = None
    rivals: Sequence[str] = ()

    @property
    def for_others(self) -> Choices:
        """The options that go for other recordings too: neither the window nor the fixed ball's circle."""
        return dataclasses.replace(self, window_us=None, fixed_ball=None)

    def parameters(self, on_rename: Callable[[str], None] | None = None) -> Parameters:
        """The preset's parameters, changed by the flights' calibration and the assignments."""
        parameters = preset(self.preset or "default", on_rename)
        if self.flight_calibration is not None:
            parameters = preset(self.flight_calibration, on_rename, parameters)
        return parameters.with_assignments(self.assignments, on_rename)


@dataclass(slots=True)
class Session:
    """An open recording, its events of the window, the parameters, and the chain that runs over them.

    `states_up` and `states_focal_length` are whether the recording or the user gives these values of the camera.
    The events of a long recording stay on disk and are read when they are needed.
    """

    recording: AnyRecording
    source: RecordedEvents
    parameters: Parameters
    chain: Chain
    warnings: list[str] = field(default_factory=list)
    read_seconds: float = 0.0
    sidecar: Sidecar = Sidecar()
    states_up: bool = False
    states_focal_length: bool = False

    @classmethod
    def open(
        cls,
        recording: AnyRecording | str | Path,
        choices: Choices = Choices(),  # frozen
        on_progress: Progress | None = None,
    ) -> Session:
        """Open a recording and read it, or index a long one; raises SpinscopeError with a remedy for what is wrong."""
        warnings: list[str] = []
        parameters = choices.parameters(warnings.append)
        begin = time.perf_counter()
        if isinstance(recording, (str, Path)):
            recording = open_recording(Path(recording), **dataclasses.asdict(choices.reading))
        report = (lambda share: on_progress(share, "reading")) if on_progress else None
        source = recorded_events(recording, choices.window_us, report)
        read_seconds = time.perf_counter() - begin
        sidecar = Sidecar.beside(recording.path) if isinstance(recording, Recording) else Sidecar()
        parameters = _with_attributes(parameters, {**recording.attributes, **sidecar.parameters}, choices)
        warnings += recording.warnings
        stated = {*recording.attributes, *sidecar.parameters, *_assigned(choices)}

        def states(name: str) -> bool:
            differs = getattr(parameters.camera, name) != getattr(CameraParameters(), name)
            return differs or f"camera.{name}" in stated

        session = cls(
            recording=recording,
            source=source,
            parameters=parameters,
            chain=_timed(source, rivals=choices.rivals),
            warnings=warnings,
            read_seconds=read_seconds,
            sidecar=sidecar,
            states_up=states("up"),
            states_focal_length=states("focal_length_mm"),
        )
        session.place_fixed_ball(choices.fixed_ball or sidecar.fixed_ball)
        return session

    @property
    def camera(self) -> Camera:
        """The camera on this sensor."""
        return Camera.of(self.parameters.camera, self.source.width_px, self.source.height_px)

    @property
    def ball_radius_m(self) -> float:
        """Radius of the ball, metres."""
        return self.parameters.ball.diameter_mm / 2000.0

    @property
    def truth(self) -> Truth | None:
        """The simulator's truth, if the recording carries it."""
        return self.recording.truth

    def ticks(
        self,
        targets: Collection[str] | None = None,
        on_progress: Progress | None = None,
        forget: Collection[str] = (),
    ) -> Iterator[Tick]:
        """Run the chain over the whole window, telling progress tick by tick; see `Chain.run`."""
        count = self.chain.tick_count(self.parameters)
        ticks = self.chain.run(self.parameters, targets, forget=forget, together=TICKS_TOGETHER)
        for index, tick in enumerate(ticks):
            yield tick
            if on_progress:
                on_progress((index + 1) / count, "running the stages")

    def load_kernels(self, method: str = "all") -> float:
        """Run a throw-away chain until every stage has had work, so that compiled kernels are in memory; seconds."""
        begin, worked, targets = time.perf_counter(), 0, method_targets(method, self.chain.rivals)
        has_contrasted = "contrast" not in targets
        ticks = Chain(self.source).run(self.parameters, targets, forget=("surface",), together=TICKS_TOGETHER)
        for index, tick in enumerate(ticks):
            flow, contrast = tick.get("flow"), tick.get("contrast")
            worked += flow is not None and len(flow.events) > 0
            has_contrasted |= contrast is not None and contrast.full
            if (worked >= WARM_UP_TICKS and has_contrasted) or index == 20 * WARM_UP_TICKS:
                break
        return time.perf_counter() - begin

    def estimate(self, method: str = "all", on_progress: Progress | None = None) -> Result:
        """Estimate the spin of every shot of the window.

        Keeps nothing of a tick but what its shots need, so that it works for recordings of any length.

        Parameters
        ----------
        method : str
            Name of one spin method, or "all"; only what it needs runs.
        on_progress : callable, optional
            Told the share done and what is being done.
        """
        targets = method_targets(method, self.chain.rivals)
        log = ShotLog.of(self.ticks(targets, on_progress, forget=STAGES.names))
        return Result(self, tuple(log.shots), log.no_shot_reason, method=method)

    def estimate_keeping_ticks(self, on_progress: Progress | None = None) -> Result:
        """Estimate by all methods and keep every tick with all its results, as the viewer needs them."""
        return Result.of(self, self.ticks(on_progress=on_progress))

    def clip_for_viewing(self, on_progress: Progress | None = None) -> Session:
        """Return this session, or for a long recording one of its first shot, with a warning that says so."""
        frame_bytes = self.source.width_px * self.source.height_px
        if self.chain.tick_count(self.parameters) * frame_bytes <= FRAMES_BYTES:
            return self
        shots = self.estimate(on_progress=on_progress).shots
        begin, end = self.source.start_us, self.source.end_us
        if shots:
            start_us = max(begin, shots[0].start_us - MARGIN_US)
            end_us = min(end, shots[0].end_us + MARGIN_US)
            what = f"its first shot of {len(shots)}"
        else:
            start_us, end_us, what = begin, end, "its beginning, for no ball was found in it"
        max_us = int(FRAMES_BYTES / frame_bytes) * self.parameters.track.tick_us
        end_us = min(end_us, start_us + max_us)
        warning = (
            f"the recording is {(end - begin) / 1e6:.1f} s long; shown is {what}, {start_us} to {end_us} us: "
            "choose another part with --window START_US END_US"
        )
        clip = self.clip(start_us, end_us)
        return dataclasses.replace(clip, warnings=[*self.warnings, warning])

    def clip(self, start_us: int, end_us: int, **chain_options: Any) -> Session:
        """A session of the part [start_us, end_us), with a chain of its own (`chain_options`: see `Chain`)."""
        source = self.source
        if (start_us, end_us) != (source.start_us, source.end_us):
            source = source.part((self.recording.identity(), (start_us, end_us)), start_us, end_us)
        chain = _timed(source, rivals=self.chain.rivals, **chain_options)
        return dataclasses.replace(self, source=source, chain=chain)

    def place_fixed_ball(self, fixed_ball: tuple[float, float, float] | str | None) -> None:
        """Keep the ball in a circle (x, y, radius in px), in the one found ("auto"), or let it fly (None)."""
        if fixed_ball is None:
            return
        values: dict[str, Any] = {"ball": "fixed"}
        if fixed_ball == "auto":
            track = self.parameters.track
            events = self.source.between(self.source.start_us, self.source.start_us + FIXED_BALL_US)
            circle, std_px = find_fixed_ball(events, self.camera, track.radius_min_px, track.radius_max_px)
            values |= {
                "fixed_x_px": circle.x_px,
                "fixed_y_px": circle.y_px,
                "fixed_radius_px": circle.radius_px,
                "fixed_std_px": std_px,
            }
            self.warnings.append(
                f"fixed ball found at x {circle.x_px:.1f}, y {circle.y_px:.1f}, radius {circle.radius_px:.1f} px, "
                f"each +-{std_px:.1f} px: give --fixed-ball X_PX Y_PX RADIUS_PX where you know better"
            )
        else:
            try:
                x, y, radius = (float(number) for number in fixed_ball)
            except (TypeError, ValueError):
                raise ParameterError(
                    f'fixed ball = {fixed_ball!r} is no circle: give x, y and radius in px, or "auto"'
                ) from None
            if not (-radius < x < self.source.width_px + radius and -radius < y < self.source.height_px + radius):
                raise ParameterError(
                    f"fixed ball = {x:g} {y:g} {radius:g} lies outside the image of "
                    f"{self.source.width_px} x {self.source.height_px} px: give X_PX Y_PX RADIUS_PX in pixels"
                )
            names = ("fixed_x_px", "fixed_y_px", "fixed_radius_px")
            values |= dict(zip(names, fixed_ball, strict=True))
        self.parameters = self.parameters.with_values({"track": values})


@dataclass(frozen=True, eq=False, repr=False)
class Result:
    """The shots found in a session, each with its track and its spin by every method.

    Attributes
    ----------
    session : Session
        Recording, parameters and chain behind it.
    shots : tuple of Shot
        In order of their start.
    no_shot_reason : str, optional
        Why there is no shot, in words; None when there are some.
    method : str
        The method asked for, or "all".
    """

    session: Session
    shots: tuple[Shot, ...]
    no_shot_reason: str | None
    method: str = "all"

    def __repr__(self) -> str:
        what = self.no_shot_reason or ", ".join(
            f"{shot.start_us} to {shot.end_us} us ({shot.best})" for shot in self.shots
        )
        return f"Result({self.session.recording.path.name}: {what})"

    @classmethod
    def of(cls, session: Session, ticks: Iterable[Tick]) -> Result:
        """The result that these ticks make, all there are or the first ones; they are kept."""
        kept = list(ticks)
        log = ShotLog.of(kept)
        result = cls(session, tuple(log.shots), log.no_shot_reason)
        result.__dict__["ticks"] = kept
        return result

    @cached_property
    def ticks(self) -> list[Tick]:
        """Every tick with all stages' results, full frames among them; computed when first asked for."""
        return list(self.session.ticks())

    def to_dict(self) -> dict[str, Any]:
        """The JSON object of `spinscope analyze` (its schema is in the contract of the command line).

        `seconds` are what reading and the stages took so far; `total` is their sum.
        """
        session, seconds = self.session, self.session.chain.seconds
        of_recording = [stage.name for stage in STAGES if stage.scope == "recording"]
        tracking = (*of_recording, "logo")
        shots = [shot.to_dict(session.camera, session.ball_radius_m) for shot in self.shots]
        for shot in shots:
            shot["spin"] = {
                name: estimate
                for name, estimate in shot["spin"].items()
                if self.method in ("all", name) or name in session.chain.rivals
            }
            if shot["best"] is not None and shot["best"] not in shot["spin"]:
                shot["best_reason"] = f"trusted is {shot['best']}, which was not asked for"
                shot["best"] = None
        return {
            "schema": SCHEMA,
            "recording": {
                "path": str(session.recording.path),
                "events": session.source.event_count,
                "duration_us": session.source.end_us - session.source.start_us,
                "width": session.source.width_px,
                "height": session.source.height_px,
            },
            "parameters": session.parameters.as_dict(),
            "shots": shots,
            "no_shot_reason": self.no_shot_reason,
            "warnings": session.warnings,
            "seconds": {
                "read": session.read_seconds,
                "track": sum(seconds.get(stage, 0.0) for stage in tracking),
                "spin": sum(taken for stage, taken in seconds.items() if stage not in tracking),
                "total": session.read_seconds + sum(seconds.values()),
            },
        }


def method_targets(method: str, rivals: Sequence[str] = ()) -> tuple[str, ...]:
    """The stages that give the estimates of a method (a name, or "all") and of rivals, and the logo's events."""
    if method == "all":
        return default_stages(rivals)
    STAGES[method]
    return ("logo", method, *rivals)


def check_method(method: str) -> str:
    """The name of a spin method, or "all"; raises ParameterError for any other."""
    known = ("all", *(one.name for one in methods()))
    if method not in known:
        raise ParameterError(f"there is no spin method {method!r}: use {', '.join(known)}")
    return method


def _timed(source: RecordedEvents, **options: Any) -> Chain:
    return Chain(source, clock=time.perf_counter, **options)


def _with_attributes(parameters: Parameters, attributes: dict[str, Any], choices: Choices) -> Parameters:
    """Take values of camera and ball that the recording or its sidecar states, unless the user set them."""
    chosen = _assigned(choices)
    for group, made in GROUPS.items():
        own = parameters.group(group)
        stated = {
            name: attributes[f"{group}.{name}"]
            for name in made.tunables()
            if f"{group}.{name}" in attributes and f"{group}.{name}" not in chosen
        }
        if choices.preset or choices.flight_calibration:
            stated = {name: value for name, value in stated.items() if getattr(own, name) == getattr(made(), name)}
        parameters = parameters.with_groups(**{group: own.with_values(stated)})
    return parameters


def _assigned(choices: Choices) -> set[str]:
    """The parameters (`group.field`) that the options set one by one."""
    return {text.partition("=")[0].strip() for text in choices.assignments}
