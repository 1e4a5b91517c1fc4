"""See, Point, Fly: fly a simulated drone by plain words, with a vision-language model or a function of your own.

    import spf

    flight = spf.fly("fly to the red crane", scene="city", seed=7)
    print(flight.outcome, flight.verified)

``fly`` flies an instruction, ``Simulator`` is flown by velocities or points, ``bench`` flies many tasks and tells success rates,
``read_log`` reads the log of a flight, and ``prompt``, ``parse_reply`` and ``lift`` are the method's own functions. Lengths are in metres, times in seconds, angles in degrees; the
world frame is east, north, up, and headings are clockwise from north.
"""

from spf import bench
from spf._native import (
    Decision,
    Flight,
    FlightLog,
    Observation,
    Query,
    Simulator,
    fly,
    lift,
    parse_reply,
    prompt,
    read_log,
    scenes,
    step_all,
)
from spf._program import ground
from spf._types import Done, Error, Hold, Move, Point, Pose, Step, Trajectory, UsageError

__all__ = [
    "Decision",
    "Done",
    "Error",
    "Flight",
    "FlightLog",
    "Hold",
    "Move",
    "Observation",
    "Point",
    "Pose",
    "Query",
    "Simulator",
    "Step",
    "Trajectory",
    "UsageError",
    "bench",
    "fly",
    "ground",
    "lift",
    "parse_reply",
    "prompt",
    "read_log",
    "scenes",
    "step_all",
]
