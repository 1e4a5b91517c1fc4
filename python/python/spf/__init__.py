"""See, Point, Fly: fly a simulated drone by plain words, with a vision-language model or a function of your own.

    import spf

    flight = spf.fly("fly to the red crane", scene="city", seed=7)
    print(flight.outcome, flight.verified)

``fly`` flies an instruction, ``Simulator`` is flown by velocities, ``read_log`` reads the log of a flight, and ``prompt``,
``parse_reply`` and ``lift`` are the method's own functions. Lengths are in metres, times in seconds, angles in degrees; the
world frame is east, north, up, and headings are clockwise from north.
"""

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
)
from spf._types import Error, Pose, Trajectory, UsageError

__all__ = [
    "Decision",
    "Error",
    "Flight",
    "FlightLog",
    "Observation",
    "Pose",
    "Query",
    "Simulator",
    "Trajectory",
    "UsageError",
    "fly",
    "lift",
    "parse_reply",
    "prompt",
    "read_log",
]
