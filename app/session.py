"""One open recording with its parameters: what the command line and the viewer work on."""

from __future__ import annotations

import dataclasses
import time
import tomllib
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from spinscope.pipeline.camera import Camera, CameraParameters
from spinscope.pipeline.chain import Chain, EventSource, Parameters, Tick
from spinscope.pipeline.errors import ParameterError, RecordingError
from spinscope.pipeline.recordings import Recording, open_recording
from spinscope.pipeline.results import Truth
from spinscope.pipeline.shots import ShotLog
from spinscope.pipeline.stages.fixed_ball import find_fixed_ball

PRESETS = Path(__file__).parent / "presets"
SAMPLES = Path(__file__).parents[1] / "sample_recordings"
DEFAULT_SAMPLE = SAMPLES / "flight_fast_top.h5"

FRAMES_BYTES = 1_500_000_000  # full frames held for the viewer: 8 s of the paper's sensor at 200 Hz
WARM_TICKS = 4  # with flow, until the spin has been solved for and solved again
TOGETHER = 4  # ticks that a stage works through at a time: tracking costs a quarter less; more surfaces cost more
MARGIN_US = 50_000  # shown before and after a shot of a long recording

Progress = Callable[[float, str], None]  # share done (0..1) and what is being done


@dataclass(frozen=True, slots=True)
class Choices:
    """What the user chose for a session, as the command line gives it."""

    preset: str | Path | None = None
    assignments: Sequence[str] = ()
    window_us: tuple[int, int] | None = None
    fixed_ball: tuple[float, float, float] | str | None = None  # (x, y, radius) in px, or "auto"
    sensor_px: tuple[int, int] | None = None

    @property
    def for_others(self) -> Choices:
        """What of it goes for other recordings too: neither the window nor the fixed ball's place."""
        return dataclasses.replace(self, window_us=None, fixed_ball=None)


@dataclass(slots=True)
class Session:
    """An open recording, its events of the window, the parameters, and the chain that runs over them."""

    recording: Recording
    source: EventSource
    parameters: Parameters
    chain: Chain
    warnings: list[str] = field(default_factory=list)
    read_seconds: float = 0.0

    @classmethod
    def open(cls, path: Path, choices: Choices, on_progress: Progress | None = None) -> Session:
        """Open and read a recording; raises SpinscopeError with a remedy for whatever is wrong with it."""
        parameters = chosen_parameters(choices)
        begin = time.perf_counter()
        recording = open_recording(path, sensor=choices.sensor_px)
        start_us, end_us = choices.window_us or (None, None)
        events = recording.read(
            start_us,
            end_us,
            on_progress=(lambda share: on_progress(share, "reading")) if on_progress else None,
        )
        if not len(events):
            raise RecordingError(_no_events(choices.window_us, path))
        window_us = choices.window_us or (int(events.t_us[0]), int(events.t_us[-1]) + 1)
        source = EventSource(
            (recording.identity(), window_us), events, recording.width_px, recording.height_px, *window_us
        )
        read_seconds = time.perf_counter() - begin
        parameters = _with_attributes(parameters, recording.attributes, choices)
        session = cls(
            recording,
            source,
            parameters,
            Chain(source, clock=time.perf_counter),
            list(recording.warnings),
            read_seconds,
        )
        session._place_fixed_ball(choices.fixed_ball)
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
        """What a simulator knows of the ball, if the recording carries it."""
        return self.recording.truth

    def ticks(
        self, on_progress: Progress | None = None, forget: Collection[str] = (), without: Collection[str] = ()
    ) -> Iterator[Tick]:
        """Run the chain over the whole window, telling progress tick by tick; see Chain.run."""
        count = self.chain.tick_count(self.parameters)
        ticks = self.chain.run(self.parameters, forget=forget, without=without, together=TOGETHER)
        for index, tick in enumerate(ticks):
            yield tick
            if on_progress:
                on_progress((index + 1) / count, "running the stages")

    def load_kernels(self, method: str = "all") -> float:
        """Run a throw-away chain until every stage has had work, so that compiled kernels are in memory; seconds."""
        begin, worked, without = time.perf_counter(), 0, not_needed(method)
        contrasted = bool(without)
        ticks = Chain(self.source).run(self.parameters, forget=("surface",), without=without, together=TOGETHER)
        for index, tick in enumerate(ticks):
            worked += len(tick.flow.t_us) > 0
            contrasted |= tick.contrast is not None and tick.contrast.full
            if (worked >= WARM_TICKS and contrasted) or index == 20 * WARM_TICKS:
                break
        return time.perf_counter() - begin

    def shots(self, on_progress: Progress | None = None, method: str = "all") -> ShotLog:
        """The shots of the window, with the estimates of one of METHODS at least; `all` for all.

        Keeps no full frames, so that it works for recordings of any length.
        """
        log = ShotLog()
        for tick in self.ticks(on_progress, forget=("surface",), without=not_needed(method)):
            log.add(tick)
        log.close()
        return log

    def all_ticks(self, on_progress: Progress | None = None) -> tuple[list[Tick], ShotLog]:
        """Every tick of the window with all its results, and the shots."""
        log, ticks = ShotLog(), []
        for tick in self.ticks(on_progress):
            log.add(tick)
            ticks.append(tick)
        log.close()
        return ticks, log

    def clip_for_viewing(self, on_progress: Progress | None = None) -> Session:
        """This session, or for a long recording one of its first shot, with a warning that says so."""
        frame_bytes = self.source.width_px * self.source.height_px
        if self.chain.tick_count(self.parameters) * frame_bytes <= FRAMES_BYTES:
            return self
        shots = self.shots(on_progress).shots
        begin, end = self.source.start_us, self.source.end_us
        if shots:
            start_us = max(begin, shots[0].start_us - MARGIN_US)
            end_us = min(end, shots[0].end_us + MARGIN_US)
            what = f"its first shot of {len(shots)}"
        else:
            start_us, end_us, what = begin, end, "its beginning, for no ball was found in it"
        most = int(FRAMES_BYTES / frame_bytes) * self.parameters.track.tick_us
        end_us = min(end_us, start_us + most)
        source = dataclasses.replace(
            self.source,
            identity=(self.recording.identity(), (start_us, end_us)),
            events=self.source.events.between(start_us, end_us),
            start_us=start_us,
            end_us=end_us,
        )
        warning = (
            f"the recording is {(end - begin) / 1e6:.1f} s long; shown is {what}, {start_us} to {end_us} us: "
            "choose another part with --window START_US END_US"
        )
        return dataclasses.replace(
            self,
            source=source,
            chain=Chain(source, clock=time.perf_counter),
            warnings=[*self.warnings, warning],
        )

    def _place_fixed_ball(self, fixed_ball: tuple[float, float, float] | str | None) -> None:
        if fixed_ball is None:
            return
        values: dict[str, Any] = {"ball": "fixed"}
        if fixed_ball == "auto":
            track = self.parameters.track
            setting = self.chain.setting(self.parameters)
            circle, std_px = find_fixed_ball(self.source.events, setting, track.radius_min_px, track.radius_max_px)
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
            x, y, radius = (float(number) for number in fixed_ball)
            if not (-radius < x < self.source.width_px + radius and -radius < y < self.source.height_px + radius):
                raise ParameterError(
                    f"--fixed-ball {x:g} {y:g} {radius:g} lies outside the image of "
                    f"{self.source.width_px} x {self.source.height_px} px: give X_PX Y_PX RADIUS_PX in pixels"
                )
            names = ("fixed_x_px", "fixed_y_px", "fixed_radius_px")
            values |= dict(zip(names, fixed_ball, strict=True))
        self.parameters = self.parameters.with_values({"track": values})


def not_needed(method: str) -> tuple[str, ...]:
    """The stages that need not run for this method (`all` or one of METHODS): contrast, which takes longest."""
    return () if method in ("all", "contrast") else ("contrast",)


def chosen_parameters(choices: Choices) -> Parameters:
    """The parameters of the preset (by name or TOML file), changed by the assignments."""
    return preset(choices.preset or "default").with_assignments(choices.assignments)


def preset(name: str | Path) -> Parameters:
    """The parameters of a preset: `default`, `paper`, or a TOML file of [stage] tables."""
    path = Path(name) if str(name).endswith(".toml") else PRESETS / f"{name}.toml"
    try:
        values = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        known = ", ".join(sorted(file.stem for file in PRESETS.glob("*.toml")))
        raise ParameterError(f"there is no preset {str(name)!r}: use {known} or the path of a .toml file") from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ParameterError(f"the preset cannot be read ({error}): {path}") from None
    return Parameters().with_values(values)


def _with_attributes(parameters: Parameters, attributes: dict[str, Any], choices: Choices) -> Parameters:
    """Take camera values that the recording states, unless the user set them."""
    chosen = {text.partition("=")[0].strip() for text in choices.assignments}
    stated = {
        name: attributes[f"camera.{name}"]
        for name in CameraParameters.tunables()
        if f"camera.{name}" in attributes and f"camera.{name}" not in chosen
    }
    if choices.preset:
        default = CameraParameters()
        stated = {k: v for k, v in stated.items() if getattr(parameters.camera, k) == getattr(default, k)}
    return dataclasses.replace(parameters, camera=parameters.camera.with_values(stated))


def _no_events(window_us: tuple[int, int] | None, path: Path) -> str:
    if window_us:
        return (
            f"there are no events from {window_us[0]} to {window_us[1]} us: "
            f"`spinscope info` shows the recording's own times: {path}"
        )
    return f"the recording holds no events: {path}"
