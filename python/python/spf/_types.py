"""Types that need no native code."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Error(Exception):
    """What failed, and why, in the program's words."""

    hint: str | None = None
    """What may help, if anything is known. It is also the last line of the message."""


class UsageError(Error, ValueError):
    """Something in the arguments, in a file or in the environment is wrong: another call may succeed."""


class Pose(NamedTuple):
    """A position and an attitude in the world frame."""

    east: float
    """Metres east of the scene's origin."""
    north: float
    """Metres north of it."""
    up: float
    """Metres above it."""
    heading_deg: float
    """Degrees clockwise from north."""
    pitch_deg: float
    """Degrees, positive nose up."""
    roll_deg: float
    """Degrees, positive right side down."""


class Trajectory(NamedTuple):
    """Poses in order of time."""

    times: NDArray[np.float64]
    """(N,), seconds of flight time."""
    poses: NDArray[np.float64]
    """(N, 6): the fields of a Pose."""


@dataclass(frozen=True)
class Point:
    """A step of a policy: towards a point of the image, as far as the paper's rule of steps says, at most 5 m."""

    x: float
    """Pixels from the left edge of the image."""
    y: float
    """Pixels from its upper edge."""
    label: float
    """Depth label, 1 to 10, which need not be whole."""


@dataclass(frozen=True)
class Move:
    """A step of a policy: a move to rest, at most 5 m along each axis. The craft turns while it flies: forward and right are of the
    heading after the turn."""

    forward: float = 0.0
    """Metres."""
    right: float = 0.0
    """Metres."""
    up: float = 0.0
    """Metres."""
    turn_deg: float = 0.0
    """Degrees, clockwise positive, at most 180."""


@dataclass(frozen=True)
class Hold:
    """A step of a policy: hold, and look again."""


@dataclass(frozen=True)
class Done:
    """A step of a policy: the instruction is fulfilled, and the flight ends."""


Step = Point | Move | Hold | Done
"""What a policy returns."""
