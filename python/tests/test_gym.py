"""The Gymnasium environments."""

import math
import subprocess
import sys
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

import spf
import spf.gym

SMALL: dict[str, Any] = {"scene": "office", "size": (32, 24)}
FAST: dict[str, Any] = {"scene": "office", "observe": "goal"}


def same(one: Any, other: Any) -> bool:
    """Whether observations or infos have the same values."""
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(same(value, other[key]) for key, value in one.items())
    return bool(np.array_equal(np.asarray(one), np.asarray(other)))


def test_gymnasium_finds_the_environments_and_the_module_needs_none_of_it() -> None:
    code = "import sys, spf; assert 'gymnasium' not in sys.modules; import gymnasium; " + (
        "print(gymnasium.make('spf.gym:spf/Point-v0', scene='office').action_space.shape)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "(3,)\n"


@pytest.mark.filterwarnings("ignore:.*symmetric and normalized")
@pytest.mark.parametrize(("name", "observe"), [("Velocity", "rgb"), ("Point", "goal")])
def test_the_checker_has_no_complaint(name: str, observe: str) -> None:
    environment = gymnasium.make(f"spf/{name}-v0", observe=observe, render_mode="rgb_array", **SMALL)
    assert isinstance(environment.unwrapped, getattr(spf.gym, name))
    check_env(environment.unwrapped)


def test_the_same_seed_is_the_same_flight() -> None:
    environment = spf.gym.Velocity(observe="rgbd", turn_deg=30, render_mode="rgb_array", **SMALL)

    def fly(seed: int) -> list[Any]:
        seen, info = environment.reset(seed=seed)
        assert environment.observation_space.contains(seen) and info["touched"] == [] and info["time_s"] > 0
        steps: list[Any] = [environment.step(np.array([0.5, 0, 0, 0.3]))[:2] for _ in range(4)]
        return [seen, *(step[0] for step in steps), {"rewards": [step[1] for step in steps]}, {"pose": info["pose"]}]

    first, again, other = fly(1), fly(1), fly(2)
    assert all(same(one, two) for one, two in zip(first, again, strict=True))
    assert not same(first[-1], other[-1]) and abs(first[-1]["pose"][3] - 90) < 30
    frame = environment.render()
    assert frame.shape == (24, 32, 3) and frame.dtype == np.uint8 and frame.flags.writeable


def towards(goal: NDArray[np.float32]) -> list[float]:
    """Velocities towards the goal: turn to it, and the faster ahead the better the craft faces it."""
    return [max(0.0, math.cos(math.radians(goal[0]))), 0.0, 0.0, goal[0] / 60]


@pytest.mark.parametrize("scene", ["city", "office", "park", "yard"])
def test_a_flight_to_the_goal_arrives_and_earns_the_distance(scene: str) -> None:
    environment = spf.gym.Velocity(scene=scene, observe="goal")
    goal, info = environment.reset(seed=3)
    assert isinstance(goal, np.ndarray) and abs(goal[0]) < 30 and goal[2] == pytest.approx(info["distance"])
    begun, earned, terminated, truncated = info["distance"], 0.0, False, False
    while not terminated and not truncated:
        goal, reward, terminated, truncated, info = environment.step(np.array(towards(np.asarray(goal))))
        earned += reward
    near = 1.0 if scene in ("office", "yard") else 5.0
    assert terminated and info["arrived"] and info["distance"] <= near < begun
    assert earned == pytest.approx(begun - info["distance"] + 10.0)


def test_points_lead_to_the_goal() -> None:
    environment = spf.gym.Point(scene="park", observe="goal")
    goal, info = environment.reset(seed=3)
    terminated, truncated, steps = False, False, 0
    while not terminated and not truncated:
        goal = np.asarray(goal)
        # The field of view is 90°, so that the image's half width is the tangent of 45°.
        u = 0.5 + 0.5 * math.tan(math.radians(max(-40.0, min(40.0, goal[0]))))
        goal, _, terminated, truncated, info = environment.step(np.array([u, 0.5, 8.0 if goal[2] > 12 else 4.0]))
        steps += 1
    assert info["arrived"] and 3 <= steps <= 12
    assert abs(info["pose"][4]) < 3, "at rest"


def test_a_collision_ends_the_episode_and_costs() -> None:
    environment = spf.gym.Velocity(penalty=7.0, **FAST)
    environment.reset(seed=1)
    for _ in range(40):
        # To the left: into the wall of the corridor.
        _, reward, terminated, truncated, info = environment.step(np.array([0, -1, 0, 0]))
        if terminated:
            break
        assert abs(reward) < 1
    assert terminated and not truncated and not info["arrived"]
    assert -8 < reward < -6 and len(info["touched"]) > 0


def test_an_episode_is_truncated() -> None:
    environment = spf.gym.Velocity(max_steps=2, dt=0.1, **FAST)
    environment.reset(seed=1)
    assert [environment.step(np.zeros(4))[2:4] for _ in range(2)] == [(False, False), (False, True)]


@pytest.mark.parametrize("craft", ["quad", "tello"])
def test_the_envelope_flies_every_action_as_given(craft: str) -> None:
    environment = spf.gym.Velocity(scene="city", craft=craft, observe="goal", turn_deg=0)
    environment.reset(seed=1)
    for action in ([1, 1, 1, 1], [-1, 1, 0.5, -1], [9, 9, 9, 9]):
        assert environment.step(np.array(action))[4]["limited"] is None


@pytest.mark.parametrize("observe", ["rgbd", "goal"])
def test_many_craft_fly_as_one_does_and_begin_anew(observe: str) -> None:
    settings: dict[str, Any] = {**SMALL, "observe": observe, "turn_deg": 40, "near": 7.9, "max_steps": 5}
    many = gymnasium.make_vec("spf.gym:spf/Velocity-v0", 2, "vector_entry_point", **settings)
    assert isinstance(many, spf.gym.VectorVelocity) and many.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    each = gymnasium.make_vec("spf.gym:spf/Velocity-v0", 2, "sync", **settings)
    assert many.observation_space == each.observation_space and many.action_space == each.action_space
    assert all(same(one, other) for one, other in zip(many.reset(seed=5), each.reset(seed=5), strict=True))
    random = np.random.default_rng(1)
    ended: list[int] = []
    for step in range(7):
        actions = random.uniform(-1, 1, (2, 4)).astype(np.float32)
        actions[0] = (1, 0, 0, 0)
        results = many.step(actions)
        assert all(same(one, other) for one, other in zip(results, each.step(actions), strict=True))
        assert many.observation_space.contains(results[0])
        if ended and ended[-1] == step - 1:
            assert results[1][0] == 0 and not results[2][0] and results[4]["distance"][0] > 7.9, "begun anew"
        if results[2][0]:
            ended.append(step)
        # The second craft does not arrive.
        assert results[3].tolist() == [False, step == 4]
    assert ended[0] < 4


def test_what_is_wrong_is_told_at_once() -> None:
    wrong: list[tuple[dict[str, Any], str]] = [
        ({"scene": "offfice"}, "offfice"),
        ({"scene": "office", "goal": "cone_fat"}, "no object `cone_fat`"),
        ({"scene": "office", "observe": "smell"}, "unknown observation"),
        ({"scene": "office", "craft": "plane"}, "craft"),
        ({"scene": "none.toml", "goal": "cone", "craft": "quad"}, "none.toml"),
    ]
    for arguments, words in wrong:
        with pytest.raises(spf.UsageError, match=words):
            spf.gym.Velocity(**arguments)
    environment = spf.gym.Velocity(**FAST)
    with pytest.raises(gymnasium.error.ResetNeeded):
        environment.step(np.zeros(4))
    many = spf.gym.VectorVelocity(2, **FAST)
    with pytest.raises(spf.UsageError, match="3 seeds for 2 craft"):
        many.reset(seed=[1, 2, 3])
