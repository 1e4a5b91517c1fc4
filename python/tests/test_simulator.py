"""The simulator that is flown by velocities."""

import threading

import numpy as np
import pytest

import spf


def test_steps_move_the_craft_and_show_what_it_sees() -> None:
    sim = spf.Simulator("office", craft="tello", seed=3, size=(160, 120))
    first = sim.observe()
    assert not first.airborne and not first.collided and first.time_s == 0.0
    up = sim.takeoff()
    obs = sim.step(forward=0.5, yaw_rate_deg_s=10, dt=2.0)
    assert obs.airborne and obs.time_s == pytest.approx(up.time_s + 2.0) and obs.limited is None
    assert obs.pose.heading_deg - up.pose.heading_deg == pytest.approx(20, abs=8)
    assert 0.3 < np.hypot(obs.pose.east - up.pose.east, obs.pose.north - up.pose.north) < 1.2
    assert obs.rgb.shape == (120, 160, 3) and obs.rgb.dtype == np.uint8
    assert obs.depth.shape == obs.ids.shape == (120, 160)
    assert obs.depth.dtype == np.float32 and obs.ids.dtype == np.uint16
    assert obs.rgb.ctypes.data == obs.rgb.ctypes.data and not obs.depth.flags.writeable
    assert set(np.unique(obs.ids)) - {0} <= set(sim.objects)
    assert sim.camera["width"] == 160 and "office" in repr(sim) and "160×120" in repr(obs)
    image, total = obs.rgb, int(obs.rgb.sum())
    del obs
    assert int(image.sum()) == total > 0


def test_the_envelope_has_the_last_word() -> None:
    sim = spf.Simulator("office")
    assert sim.step(forward=1.0, dt=0.5).limited is not None
    sim.takeoff()
    with pytest.raises(spf.UsageError, match="refuses the take-off"):
        sim.takeoff()
    fast = sim.step(forward=50, dt=0.5)
    assert fast.limited is not None and np.linalg.norm(fast.velocity) < 2
    for arguments in ({"forward": float("nan")}, {"dt": 0.0}, {"dt": 1e9}):
        with pytest.raises(spf.UsageError):
            sim.step(**arguments)
    assert sim.step(forward=1.0, dt=40).collided
    assert len(sim.observe().touched) > 0
    with pytest.raises(spf.UsageError, match="is inside|not above"):
        spf.Simulator("city", start=(9000, 0, 3, 0))
    with pytest.raises(spf.UsageError, match="cannot be rendered"):
        spf.Simulator("office", size=(0, 10))


def test_two_threads_with_two_simulators() -> None:
    images: dict[str, bytes] = {}

    def fly(name: str) -> None:
        sim = spf.Simulator("park", seed=5, size=(64, 48))
        sim.takeoff()
        obs = [sim.step(forward=1.0, yaw_rate_deg_s=15, dt=0.1) for _ in range(20)][-1]
        images[name] = obs.rgb.tobytes() + obs.depth.tobytes()

    threads = [threading.Thread(target=fly, args=(name,)) for name in ("one", "two")]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert images["one"] == images["two"]


def test_a_point_is_flown_to() -> None:
    sim = spf.Simulator("office", seed=1, size=(64, 48))
    with pytest.raises(spf.UsageError, match="take off"):
        sim.point((0.5, 0.5), 4)
    up = sim.takeoff()
    there = sim.point((0.5, 0.5), 4)
    assert np.linalg.norm(np.subtract(there.pose[:3], up.pose[:3])) == pytest.approx(1.92, abs=0.15)
    key = next(key for key in sim.places if "whiteboard" in key)
    centre = np.subtract(sim.places[key], there.pose[:3])
    assert 0 < there.distance_to(key) <= np.linalg.norm(centre)
    with pytest.raises(spf.UsageError, match="no object"):
        there.distance_to("unicorn")


def test_many_step_at_once_as_one_after_another() -> None:
    def fleet() -> list[spf.Simulator]:
        sims = [spf.Simulator("office", seed=seed, size=(64, 48)) for seed in range(3)]
        for sim in sims:
            sim.takeoff()
        return sims

    actions = np.array([[0.4, 0.0, 0.0, 10.0], [0.0, 0.2, 0.1, 0.0], [0.3, 0.0, 0.0, -20.0]])
    together = spf.step_all(fleet(), actions, dt=0.5)
    for sim, (forward, right, up, yaw), one in zip(fleet(), actions, together, strict=True):
        alone = sim.step(forward=forward, right=right, up=up, yaw_rate_deg_s=yaw, dt=0.5)
        assert alone.pose == one.pose and (alone.rgb == one.rgb).all()
    with pytest.raises(spf.UsageError, match="3 simulators"):
        spf.step_all(fleet(), actions[:2])
