"""Types that need no native code."""

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
