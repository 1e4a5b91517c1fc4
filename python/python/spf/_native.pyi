from collections.abc import Callable, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, Literal, Protocol, final

import numpy as np
from numpy.typing import NDArray

from spf._types import Pose, Step, Trajectory

__all__ = [
    "Decision",
    "Flight",
    "FlightLog",
    "Observation",
    "Query",
    "Simulator",
    "bench_pairs",
    "bench_rates",
    "bench_rows",
    "bench_run",
    "bench_suites",
    "fly",
    "lift",
    "parse_reply",
    "prompt",
    "read_log",
    "scenes",
    "step_all",
]

@final
class Query:
    @property
    def instruction(self) -> str: ...
    @property
    def prompt(self) -> str: ...
    @property
    def image(self) -> NDArray[np.uint8]: ...
    @property
    def schema(self) -> dict[str, Any] | None: ...
    @property
    def confirming(self) -> bool: ...
    @property
    def number(self) -> int: ...
    @property
    def moves(self) -> list[str]: ...
    @property
    def near_m(self) -> float | None: ...
    @property
    def history(self) -> dict[str, Any]: ...
    def lift(self, point: tuple[float, float], label: float) -> dict[str, float]: ...

@final
class Decision:
    @property
    def number(self) -> int: ...
    @property
    def time_s(self) -> float: ...
    @property
    def text(self) -> str: ...
    @property
    def step(self) -> str: ...
    @property
    def reply(self) -> str: ...
    @property
    def prompt(self) -> str: ...
    @property
    def pose(self) -> Pose: ...
    @property
    def goal(self) -> Pose | None: ...
    def to_dict(self) -> dict[str, Any]: ...

@final
class Flight:
    @property
    def outcome(self) -> Literal["reached", "not_found", "timeout", "collision", "aborted", "failed"]: ...
    @property
    def verified(self) -> bool | None: ...
    @property
    def cause(self) -> str: ...
    @property
    def targets(self) -> list[str]: ...
    @property
    def decisions(self) -> list[Decision]: ...
    @property
    def trajectory(self) -> Trajectory: ...
    @property
    def true_trajectory(self) -> Trajectory: ...
    @property
    def summary(self) -> dict[str, Any]: ...
    @property
    def folder(self) -> Path: ...
    @property
    def log_path(self) -> Path: ...
    @property
    def map_path(self) -> Path: ...
    @property
    def video_path(self) -> Path | None: ...
    @property
    def announcements(self) -> list[str]: ...
    @property
    def recording_problems(self) -> list[str]: ...
    def _repr_html_(self) -> str: ...

@final
class FlightLog:
    @property
    def header(self) -> dict[str, Any]: ...
    @property
    def decisions(self) -> list[Decision]: ...
    @property
    def trajectory(self) -> Trajectory: ...
    @property
    def true_trajectory(self) -> Trajectory: ...
    @property
    def summary(self) -> dict[str, Any] | None: ...
    @property
    def is_truncated(self) -> bool: ...

@final
class Observation:
    @property
    def rgb(self) -> NDArray[np.uint8]: ...
    @property
    def depth(self) -> NDArray[np.float32]: ...
    @property
    def ids(self) -> NDArray[np.uint16]: ...
    @property
    def pose(self) -> Pose: ...
    @property
    def velocity(self) -> tuple[float, float, float]: ...
    @property
    def time_s(self) -> float: ...
    @property
    def airborne(self) -> bool: ...
    @property
    def collided(self) -> bool: ...
    @property
    def touched(self) -> list[str]: ...
    @property
    def limited(self) -> str | None: ...
    def distance_to(self, key: str) -> float: ...

@final
class Simulator:
    def __new__(
        cls,
        scene: str = "city",
        *,
        craft: Literal["quad", "tello"] | None = None,
        seed: int = 0,
        start: Sequence[float] | None = None,
        size: tuple[int, int] | None = None,
    ) -> Simulator: ...
    def takeoff(self) -> Observation: ...
    def land(self) -> Observation: ...
    def step(
        self,
        *,
        forward: float = 0.0,
        right: float = 0.0,
        up: float = 0.0,
        yaw_rate_deg_s: float = 0.0,
        dt: float = 0.1,
    ) -> Observation: ...
    def point(self, point: tuple[float, float], label: float) -> Observation: ...
    def observe(self) -> Observation: ...
    @property
    def camera(self) -> dict[str, Any]: ...
    @property
    def speeds(self) -> tuple[float, float, float, float]: ...
    @property
    def near_m(self) -> float: ...
    @property
    def objects(self) -> dict[int, str]: ...
    @property
    def places(self) -> dict[str, tuple[float, float, float]]: ...

class _Policy(Protocol):
    def handle(self, event: Query, /) -> Step: ...

def fly(
    instruction: str,
    *,
    scene: str = "city",
    seed: int = 0,
    craft: Literal["quad", "tello"] | None = None,
    start: Sequence[float] | None = None,
    vlm: str | Callable[[Query], str | dict[str, Any]] | None = None,
    policy: Callable[[Query], Step] | _Policy | None = None,
    drone: str = "sim",
    unattended: bool = False,
    flags: Sequence[str] | None = None,
    on_decision: Callable[[Decision], object] | None = None,
    avoid: bool | None = None,
    depth_sensor: bool = False,
    preset: Literal["default", "paper"] = "default",
    max_time_s: float | None = None,
    max_decisions: int | None = None,
    max_queries: int | None = None,
    max_cost_usd: float | None = None,
    vlm_latency_s: float | None = None,
    anyway: bool = False,
    video: bool = False,
    out: str | PathLike[str] | None = None,
) -> Flight: ...
def read_log(path: str | PathLike[str]) -> FlightLog: ...
def lift(
    point: tuple[float, float],
    label: float,
    *,
    craft: Literal["quad", "tello"] = "quad",
    camera: tuple[int, int, float, float] | None = None,
    tilt_deg: float = 0.0,
    pitch_deg: float = 0.0,
    roll_deg: float = 0.0,
    fixed_step_m: float | None = None,
    levelled: bool = True,
) -> dict[str, float]: ...
def parse_reply(
    text: str,
    *,
    family: str = "oracle",
    size: tuple[int, int] | None = None,
    avoid: bool = False,
) -> dict[str, Any]: ...
def prompt(
    instruction: str,
    *,
    family: str = "oracle",
    size: tuple[int, int] | None = None,
    avoid: bool = False,
    near_m: float | None = None,
    keep_m: float | None = None,
    field_deg: tuple[float, float] | None = None,
    horizon: float | None = None,
) -> str: ...
def step_all(
    simulators: Sequence[Simulator],
    actions: Sequence[Sequence[float]] | NDArray[np.float64],
    *,
    dt: float = 0.1,
) -> list[Observation]: ...
def bench_run(
    suite: str | None,
    tasks: list[str],
    methods: list[str],
    vlms: list[str],
    function: Callable[[Query], str | dict[str, Any]] | None,
    name: str | None,
    policy: Callable[[Query], Step] | _Policy | None,
    trials: int,
    seed: int,
    folder: str | PathLike[str],
    jobs: int | None,
    max_cost_usd: float | None,
    vlm_latency_s: float | None,
    on_progress: Callable[[int, int], object] | None,
) -> list[dict[str, Any]]: ...
def bench_rows(folder: str | PathLike[str]) -> list[dict[str, Any]]: ...
def bench_rates(rows: list[dict[str, Any]]) -> list[dict[str, Any]]: ...
def bench_pairs(
    first: list[dict[str, Any]],
    second: list[dict[str, Any]],
    verdict: Literal["strict", "paper"],
) -> list[dict[str, Any]]: ...
def bench_suites() -> list[tuple[str, list[str]]]: ...
def scenes() -> list[str]: ...
