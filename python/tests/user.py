"""What a user writes, for the type checker: `mypy --strict`."""

from typing import assert_type

import numpy as np
from numpy.typing import NDArray

import spf


def my_vlm(query: spf.Query) -> dict[str, object]:
    assert_type(query.image, NDArray[np.uint8])
    height, width, _ = query.image.shape
    return {"status": "navigating", "point": [width / 2, height / 2], "depth": 3}


def main() -> None:
    flight = spf.fly("fly to the red crane", scene="city", seed=7, vlm=my_vlm, on_decision=print)
    assert_type(flight.verified, bool | None)
    assert_type(flight.trajectory.poses, NDArray[np.float64])
    sim = spf.Simulator("office", craft="tello", seed=3)
    sim.takeoff()
    obs = sim.step(forward=0.5, yaw_rate_deg_s=10, dt=0.1)
    assert_type(obs.pose.heading_deg, float)
    assert_type(spf.read_log(flight.log_path).decisions, list[spf.Decision])
    try:
        spf.lift((0.5, 2.0), 3)
    except spf.Error as error:
        assert_type(error.hint, str | None)


if __name__ == "__main__":
    main()
