"""Gymnasium environments: a craft is to fly to an object of a scene.

    import gymnasium

    env = gymnasium.make("spf.gym:spf/Velocity-v0", scene="park", goal="gate_1")
    image, info = env.reset(seed=1)
    image, reward, terminated, truncated, info = env.step([1.0, 0.0, 0.0, 0.2])

The actions of ``spf/Velocity-v0`` are velocities; those of ``spf/Point-v0`` are a point of the image and a depth label, as a VLM
gives them. ``VectorVelocity`` flies many craft at once. The part of the id before the colon imports this module, which registers
the environments; after ``import spf.gym`` the id alone does. It needs ``gymnasium``, from 1.1 on.

An episode begins in the air. Every step gives as its reward the metres by which the craft came closer to the surface of the goal;
``bonus`` is added on arrival, and ``penalty`` taken off for a collision. Both end the episode; after ``max_steps`` steps it is truncated.

The dictionary ``info`` has ``pose``, (6,), the fields of a spf.Pose; ``distance``, metres to the surface of the goal; ``arrived``;
``touched``, keys of what the craft has hit; ``limited``, why the safety envelope did not fly the step as given, or None; ``time_s``.
"""

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Literal, cast

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space, concatenate, create_empty_array
from numpy.typing import NDArray

import spf

__all__ = ["Point", "Seen", "Task", "VectorVelocity", "Velocity"]

Seen = NDArray[Any] | dict[str, NDArray[Any]]
"""An observation: an array, or two by name."""

_Step = tuple[Seen, float, bool, bool, dict[str, Any]]

# The default goal of the built-in scenes, with their own craft.
_GOALS = {"city": "taxi", "office": "cone_far", "park": "gate_1", "yard": "garden_table"}
# Farther than anything in a scene, metres.
_FAR = 10_000.0


def _wrong(message: str, hint: str) -> spf.UsageError:
    error = spf.UsageError(f"{message}\n\nhint: {hint}")
    error.hint = hint
    return error


class Task:
    """Where a craft flies to, and what it is shown: the arguments that all environments have.

    scene: a built-in scene or the path of a scene file. goal: key of an object, as in Simulator.places; by default one that is in view
    at the start, 5 to 30 m away; a scene file needs one. craft: quad or tello; the scene's own by default. start: east, north, up and
    heading, as of spf.Simulator; turn_deg: at each reset the heading of the start is turned by up to so much to either side.

    size: width and height of the images in pixels. observe: what an observation is:
    "rgb": the camera's image, (H, W, 3) of uint8.
    "rgbd": a dictionary of this image as "rgb" and the depth of its pixels as "depth", (H, W) of float32, metres, 0 where there is nothing.
    "goal": (3,) of float32: how far the goal's centre is to the right of the nose and above the horizon, in degrees, and the metres to
    its surface. Nothing is rendered, which is much faster.

    near: the craft has arrived at so many metres from the goal's surface; what the scene counts as reached by default. bonus, penalty: what
    an arrival earns and a collision costs, in metres of progress.
    """

    def __init__(
        self,
        scene: str = "park",
        *,
        goal: str | None = None,
        craft: Literal["quad", "tello"] | None = None,
        start: Sequence[float] | None = None,
        turn_deg: float = 0.0,
        size: tuple[int, int] = (64, 48),
        observe: Literal["rgb", "rgbd", "goal"] = "rgb",
        near: float | None = None,
        bonus: float = 10.0,
        penalty: float = 10.0,
    ) -> None:
        if observe not in ("rgb", "rgbd", "goal"):
            raise _wrong(f"unknown observation `{observe}`", "rgb, rgbd or goal")
        self.scene, self.craft, self.turn_deg = scene, craft, turn_deg
        self.size, self.observe, self.bonus, self.penalty = size, observe, bonus, penalty
        # What is wrong in the arguments is told at once.
        simulator = self._simulator(0, start)
        goal = goal or _GOALS.get(scene.partition("@")[0])
        if goal is None:
            raise _wrong(f"`{scene}` has no default goal", "give the key of an object as goal, as in Simulator.places")
        first = simulator.observe()
        first.distance_to(goal)
        self.goal = goal
        pose = first.pose
        self.start = (pose.east, pose.north, pose.up, pose.heading_deg) if start is None else start
        self.near = simulator.near_m if near is None else near
        self.speeds = simulator.speeds

    def _simulator(self, seed: int, start: Sequence[float] | None) -> spf.Simulator:
        return spf.Simulator(self.scene, craft=self.craft, seed=seed, start=start, size=self.size)

    def begin(self, random: np.random.Generator) -> spf.Simulator:
        """A craft in the air, at the start."""
        seed = int(random.integers(2**32))
        turn = float(random.uniform(-self.turn_deg, self.turn_deg))
        east, north, up, heading, *pitch = self.start
        simulator = self._simulator(seed, (east, north, up, heading + turn, *pitch))
        simulator.takeoff()
        return simulator

    def space(self) -> spaces.Space[Any]:
        """Of the observations."""
        width, height = self.size
        rgb = spaces.Box(0, 255, (height, width, 3), np.uint8)
        if self.observe == "rgbd":
            return spaces.Dict({"rgb": rgb, "depth": spaces.Box(0.0, _FAR, (height, width), np.float32)})
        if self.observe == "goal":
            return spaces.Box(np.array([-180, -90, 0], np.float32), np.array([180, 90, _FAR], np.float32))
        return rgb

    def seen(self, simulator: spf.Simulator, now: spf.Observation) -> Seen:
        """What is shown of this instant: arrays of its own."""
        if self.observe == "rgb":
            return np.array(now.rgb)
        if self.observe == "rgbd":
            return {"rgb": np.array(now.rgb), "depth": np.array(now.depth)}
        pose, place = now.pose, simulator.places[self.goal]
        east, north, up = place[0] - pose.east, place[1] - pose.north, place[2] - pose.up
        bearing = (math.degrees(math.atan2(east, north)) - pose.heading_deg + 180) % 360 - 180
        elevation = math.degrees(math.atan2(up, math.hypot(east, north)))
        return np.array([bearing, elevation, now.distance_to(self.goal)], np.float32)


class _Episode:
    """One craft under way."""

    def __init__(self, task: Task, max_steps: int) -> None:
        self.task, self.max_steps = task, max_steps
        self.steps, self.distance = 0, math.inf
        self.now: spf.Observation | None = None
        self._simulator: spf.Simulator | None = None

    @property
    def simulator(self) -> spf.Simulator:
        if self._simulator is None:
            raise gymnasium.error.ResetNeeded("call reset before the first step")
        return self._simulator

    def begin(self, random: np.random.Generator) -> tuple[Seen, dict[str, Any]]:
        self._simulator = self.task.begin(random)
        self.now, self.steps = self._simulator.observe(), 0
        self.distance = self.now.distance_to(self.task.goal)
        return self.task.seen(self._simulator, self.now), self._info(self.now)

    def judge(self, now: spf.Observation) -> _Step:
        """What the environment returns for a step that ended here."""
        before, self.now, self.distance = self.distance, now, now.distance_to(self.task.goal)
        self.steps += 1
        info = self._info(now)
        reward = before - self.distance
        if now.collided:
            reward -= self.task.penalty
        elif info["arrived"]:
            reward += self.task.bonus
        terminated = now.collided or bool(info["arrived"])
        truncated = not terminated and self.steps >= self.max_steps
        return self.task.seen(self.simulator, now), reward, terminated, truncated, info

    def _info(self, now: spf.Observation) -> dict[str, Any]:
        return {
            "pose": np.array(now.pose, np.float64),
            "distance": self.distance,
            "arrived": not now.collided and self.distance <= self.task.near,
            "touched": now.touched,
            "limited": now.limited,
            "time_s": now.time_s,
        }

    def frame(self) -> NDArray[np.uint8]:
        if self.now is None:
            raise gymnasium.error.ResetNeeded("call reset before render")
        return np.array(self.now.rgb)


class _Env(gymnasium.Env[Seen, NDArray[np.float32]]):
    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 4}

    def __init__(self, task: Task, max_steps: int, render_mode: str | None) -> None:
        self.task, self.render_mode = task, render_mode
        self.observation_space = task.space()
        self._episode = _Episode(task, max_steps)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Seen, dict[str, Any]]:
        """Begins an episode, with the craft in the air. The same seed and actions give the same observations; options are not used."""
        super().reset(seed=seed)
        return self._episode.begin(self.np_random)

    def render(self) -> Any:
        """The camera's image, (H, W, 3) of uint8, with render_mode="rgb_array"."""
        return self._episode.frame() if self.render_mode == "rgb_array" else None


def _velocities(actions: NDArray[Any], task: Task) -> NDArray[np.float64]:
    """Of actions from -1 to 1: m/s forward, right and up; degrees per second."""
    return np.clip(np.asarray(actions, np.float64), -1, 1) * task.speeds


class Velocity(_Env):
    """spf/Velocity-v0: the craft is flown by velocities.

    An action is (4,), from -1 to 1: forward, right and up in the level body frame, and the yaw rate, clockwise positive; 1 is the preset
    speed of the craft: 3, 3 and 1 m/s and 95 degrees per second for a quad, 1, 1 and 0.8 m/s and 95 degrees per second for a tello.
    A step lasts dt seconds. Nothing brakes before an obstacle. Other arguments are those of a Task.
    """

    def __init__(self, *, dt: float = 0.25, max_steps: int = 200, render_mode: str | None = None, **task: Any) -> None:
        super().__init__(Task(**task), max_steps, render_mode)
        self.dt = dt
        self.metadata = {**self.metadata, "render_fps": max(1, round(1 / dt))}
        self.action_space = spaces.Box(-1.0, 1.0, (4,), np.float32)

    def step(self, action: NDArray[Any]) -> _Step:
        """Flies with these velocities for dt seconds."""
        forward, right, up, yaw = _velocities(action, self.task).tolist()
        simulator = self._episode.simulator
        return self._episode.judge(simulator.step(forward=forward, right=right, up=up, yaw_rate_deg_s=yaw, dt=self.dt))


class Point(_Env):
    """spf/Point-v0: the craft is flown as SPF flies it, by points of the image.

    An action is (3,): u and v from 0 to 1, as parts of the image's width and height from its upper left corner, and a depth label from 1
    to 10, which need not be whole. The craft flies the step of the method (spf.lift) towards that point, until it is at rest: some seconds,
    or half a minute where the safety envelope does not let it arrive. Nothing brakes before an obstacle. A learner that expects actions from -1 to 1 is served by
    gymnasium.wrappers.RescaleAction(env, -1, 1). Other arguments are those of a Task.
    """

    def __init__(self, *, max_steps: int = 30, render_mode: str | None = None, **task: Any) -> None:
        super().__init__(Task(**task), max_steps, render_mode)
        self.metadata = {**self.metadata, "render_fps": 1}
        self.action_space = spaces.Box(np.array([0, 0, 1], np.float32), np.array([1, 1, 10], np.float32))

    def step(self, action: NDArray[Any]) -> _Step:
        """Flies the step towards a point of the last image."""
        u, v, label = np.clip(np.asarray(action, np.float64), (0, 0, 1), (1, 1, 10)).tolist()
        return self._episode.judge(self._episode.simulator.point((u, v), label))


class VectorVelocity(VectorEnv[Seen, NDArray[np.float32], NDArray[Any]]):
    """Many craft of spf/Velocity-v0 at once, each in a scene of its own: flown and rendered in threads.

    Made by gymnasium.make_vec("spf.gym:spf/Velocity-v0", num_envs=16). Arguments, actions and results are those of Velocity, in arrays
    with one row for each craft. An episode that has ended begins anew in the next step (AutoresetMode.NEXT_STEP): that step ignores the
    action, returns the first observation of the new episode, and rewards with 0. reset(seed=7) gives the craft the seeds 7, 8, 9 and so on.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 4, "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(
        self, num_envs: int = 1, *, dt: float = 0.25, max_steps: int = 200, render_mode: str | None = None, **task: Any
    ) -> None:
        self.num_envs, self.dt, self.render_mode = num_envs, dt, render_mode
        self.metadata = {**self.metadata, "render_fps": max(1, round(1 / dt))}
        self.task = Task(**task)
        self.single_observation_space = self.task.space()
        self.single_action_space = spaces.Box(-1.0, 1.0, (4,), np.float32)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._episodes = [_Episode(self.task, max_steps) for _ in range(num_envs)]
        self._random: list[np.random.Generator | None] = [None] * num_envs
        self._over = np.zeros(num_envs, np.bool_)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Seen, dict[str, Any]]:
        """Begins all episodes. seed: of the first craft, or one for each."""
        seeds = [None if seed is None else seed + index for index in range(self.num_envs)] if not isinstance(seed, Sequence) else list(seed)
        if len(seeds) != self.num_envs:
            raise _wrong(f"{len(seeds)} seeds for {self.num_envs} craft", "give one number, or one for each")
        self._random = [
            before if before is not None and one is None else seeding.np_random(one)[0]
            for before, one in zip(self._random, seeds, strict=True)
        ]
        self._over[:] = False
        infos: dict[str, Any] = {}
        begun = self._begin(range(self.num_envs))
        for index, (_, info) in begun.items():
            infos = self._add_info(infos, info, index)
        return self._batch([seen for seen, _ in begun.values()]), infos

    def step(self, actions: NDArray[Any]) -> tuple[Seen, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Flies with these velocities, (N, 4), for dt seconds; begins the episodes anew that have ended."""
        velocities = _velocities(actions, self.task)
        flying: list[int] = np.flatnonzero(~self._over).tolist()
        begun = self._begin(np.flatnonzero(self._over).tolist())
        flown = dict(zip(flying, self._fly([self._episodes[index].simulator for index in flying], velocities[flying]), strict=True))
        seen: list[Seen] = []
        infos: dict[str, Any] = {}
        rewards = np.zeros(self.num_envs, np.float64)
        terminated, truncated = np.zeros(self.num_envs, np.bool_), np.zeros(self.num_envs, np.bool_)
        for index, episode in enumerate(self._episodes):
            if index in begun:
                one, info = begun[index]
            else:
                one, rewards[index], terminated[index], truncated[index], info = episode.judge(flown[index])
            seen.append(one)
            infos = self._add_info(infos, info, index)
        self._over = terminated | truncated
        return self._batch(seen), rewards, terminated, truncated, infos

    def render(self) -> Any:
        """The images of all craft, with render_mode="rgb_array"."""
        return tuple(episode.frame() for episode in self._episodes) if self.render_mode == "rgb_array" else None

    def _begin(self, indices: Sequence[int]) -> dict[int, tuple[Seen, dict[str, Any]]]:
        def begin(index: int) -> tuple[Seen, dict[str, Any]]:
            random = self._random[index]
            if random is None:
                raise gymnasium.error.ResetNeeded("call reset before the first step")
            return self._episodes[index].begin(random)

        if len(indices) == 0:
            return {}
        with ThreadPoolExecutor() as pool:
            return dict(zip(indices, pool.map(begin, indices), strict=True))

    def _fly(self, simulators: list[spf.Simulator], velocities: NDArray[np.float64]) -> list[spf.Observation]:
        if self.task.observe != "goal":
            return spf.step_all(simulators, velocities, dt=self.dt)
        # Without rendering, threads do not pay.
        rows = zip(simulators, velocities.tolist(), strict=True)
        return [one.step(forward=row[0], right=row[1], up=row[2], yaw_rate_deg_s=row[3], dt=self.dt) for one, row in rows]

    def _batch(self, seen: list[Seen]) -> Seen:
        empty: Any = create_empty_array(self.single_observation_space, n=self.num_envs)
        batch: Any = concatenate(self.single_observation_space, seen, empty)
        return cast(Seen, batch)


gymnasium.register("spf/Velocity-v0", entry_point="spf.gym:Velocity", vector_entry_point="spf.gym:VectorVelocity")
gymnasium.register("spf/Point-v0", entry_point="spf.gym:Point")
