#!/usr/bin/env python3
"""Simulators of drones from Python, without a GPU, on one machine in one hour: steps and images per second.

    python3 docs/bench/python_speed.py [--wheel FILE] [--seconds 1] [--rounds 3] [--only NAME,NAME] [--pictures FILE.png] [--quick]

Measures the wheel of SPF (the newest in target/wheels; `.ci/release --wheel` builds it) beside PyFlyt, PyBullet and hyperdrone from
PyPI, and prints Markdown tables. Creates its own Python environment, target/python-speed-venv. hyperdrone compiles itself when it is
first used, which takes some minutes once; for that it needs a C++ compiler, and either GitHub or the Debian packages
nlohmann-json3-dev, libassimp-dev and libstb-dev. The reason for each program that cannot be run is printed under the tables. Each figure
is the median of the rounds; rounds alternate, so that a busy minute affects all alike. Nothing else should run meanwhile.

A step is 1/30 s of flight for all. Every image is an array of NumPy in the process that asked for it, and every step without one gives
the pose. 16 craft are 16 worlds: SPF steps them in threads of one process, the others in two processes of 8 each, whose images lie in
shared memory. Two cores are used, however many there are.
"""

import argparse
import json
import math
import multiprocessing
import os
import platform
import resource
import statistics
import subprocess
import sys
import time
from multiprocessing import shared_memory
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
VENV = ROOT / "target/python-speed-venv"
WORK = ROOT / "target/python-speed"
PACKAGES = ["PyFlyt==0.29.0", "pybullet==3.2.7", "hyperdrone==0.1.8", "cmake==4.4.5", "pillow==13.0.0"]
CORES = 2
FLEET = 16
# None: no images.
SIZES = [None, (64, 48), (320, 240), (960, 720)]
PICTURE = (320, 240)
RATE = 30
# Each world is made anew after so many steps, 5 minutes of flight, so that no battery runs out.
LONGEST = 9000
# What each craft is to fly where it has a controller: a circle.
FORWARD, TURN = 1.0, math.radians(30)
HEIGHT = 2.0
# The field of view of SPF's camera in its scene `city`.
VERTICAL_FOV = 73.7
TO_SUN = (0.4, 0.3, 0.85)
SKY = (0.62, 0.72, 0.82)

# Name → (class, its arguments, what it draws, what a step is).
PROGRAMS = {
    "spf": (
        "Spf", {},
        "SPF: scene `city`, procedural textures, sun shadows, ambient occlusion, haze, edges anti-aliased",
        "6 or 7 ticks of 5 ms: dead time, lag, tilt, drag, battery, contacts with the scene, telemetry with noise; a velocity through"
        " the safety envelope. 16: one thread without images, `spf.step_all` with them. An image uses both cores"),
    "pyflyt": (
        "PyFlyt", {},
        "PyFlyt: a plane and 32 boxes by PyBullet's TinyRenderer, no shadows, no anti-aliasing, segmentation with each image",
        "8 of Bullet's at 240 Hz, 4 of its controllers (mode 5, velocities) in Python at 120 Hz; motors with lag and"
        " noise, drag, contacts"),
    "pybullet": (
        "PyBullet", {"shadow": 1},
        "PyBullet: the same by TinyRenderer with its shadow pass (few shadows show), no segmentation, no anti-aliasing",
        "8 of Bullet's at 240 Hz: a rigid body under the constant thrust of 4 rotors, contacts; no controller, no motors"),
    "pybullet-plain": ("PyBullet", {"shadow": 0}, "PyBullet: the same without shadows", "as above"),
    "hyperdrone": (
        "HyperDrone", {"fidelity": "medium", "grid": 1},
        "hyperdrone: the same by its ray tracer on the CPU, fidelity `medium` as in its examples, no shadows, no anti-aliasing",
        "3 of its own at 90 Hz: a rigid body and 4 motors with lag; no controller, no contacts. 16 without images: one batch, one process"),
    "hyperdrone-best": (
        "HyperDrone", {"fidelity": "veryhigh", "grid": 2},
        "hyperdrone: the same, fidelity `veryhigh` with shadows, 4 samples a pixel",
        "as above"),
}


def boxes():
    """Houses around the start, for peers: (east, north), (width, depth, height), colour."""
    import numpy

    random = numpy.random.default_rng(1)
    houses = []
    for index in range(32):
        angle, distance = 2 * math.pi * index / 32, random.uniform(8, 35)
        at = (distance * math.cos(angle), distance * math.sin(angle))
        houses.append((at, tuple(random.uniform((2, 2, 2), (6, 6, 12))), tuple(random.uniform(0.2, 0.9, 3))))
    return houses


# ---------------------------------------------------------------- each in its own process
#
# A class is a number of craft, each in its own world. `advance` flies them for one step and returns their images, (N, H, W, 3 or 4), or
# their poses. `check` raises an error unless they still fly. WORKERS says whether more than one craft is given to two processes.


class Spf:
    WORKERS = False
    # A scene is loaded and prepared once, and kept while a simulator of it lives.
    kept = None

    def __init__(self, count, size, first=0):
        import spf

        Spf.kept = Spf.kept or spf.Simulator("city")
        at = Spf.kept.observe().pose
        self.size, self.step_all, self.now = size, spf.step_all, []
        # Without images nothing is rendered, whatever the size.
        self.craft = [
            spf.Simulator("city", seed=index, size=size or (64, 48), start=(at.east, at.north, at.up, at.heading_deg + 360 * index / FLEET))
            for index in range(first, first + count)]
        for one in self.craft:
            one.takeoff()
        self.actions = [[FORWARD, 0.0, 0.0, math.degrees(TURN)]] * count

    def advance(self):
        if self.size is None:
            turn = math.degrees(TURN)
            self.now = [one.step(forward=FORWARD, yaw_rate_deg_s=turn, dt=1 / RATE) for one in self.craft]
            return [one.pose for one in self.now]
        if len(self.craft) == 1:
            self.now = [self.craft[0].step(forward=FORWARD, yaw_rate_deg_s=math.degrees(TURN), dt=1 / RATE)]
        else:
            self.now = self.step_all(self.craft, self.actions, dt=1 / RATE)
        return [one.rgb for one in self.now]

    def check(self):
        for one in self.now:
            if one.collided or not one.airborne or one.limited:
                raise RuntimeError(f"a craft of SPF does not fly: {one!r} {one.touched} {one.limited}")

    def close(self):
        pass


class PyFlyt:
    WORKERS = True

    def __init__(self, count, size, first=0):
        import numpy
        from PyFlyt.core import Aviary

        self.size, self.worlds = size, []
        camera = {}
        if size:
            # Per step of 1/30 s one image, as in its environments for Gymnasium.
            camera = {
                "use_camera": True, "camera_resolution": size[::-1], "camera_fps": RATE, "camera_FOV_degrees": round(VERTICAL_FOV)}
        for index in range(first, first + count):
            world = Aviary(
                start_pos=numpy.array([[0.0, 0.0, HEIGHT]]), start_orn=numpy.array([[0.0, 0.0, 2 * math.pi * index / FLEET]]),
                drone_type="quadx", drone_options=camera, seed=index + 1)
            bullet_boxes(world)
            world.register_all_new_bodies()
            world.set_mode(5)
            world.set_setpoint(0, numpy.array([FORWARD, 0.0, TURN, 0.0]))
            self.worlds.append(world)
        numpy_images(self.worlds[0])

    def advance(self):
        for world in self.worlds:
            for _ in range(120 // RATE):
                world.step()
        return [world.drones[0].rgbaImg if self.size else world.state(0) for world in self.worlds]

    def check(self):
        for world in self.worlds:
            if world.state(0)[3, 2] < 0.2 or world.contact_array.any():
                raise RuntimeError(f"a craft of PyFlyt does not fly: {world.state(0)[3]}")

    def close(self):
        for world in self.worlds:
            world.disconnect()


class PyBullet:
    WORKERS = True
    # Of the URDF, metres and newtons.
    ROTORS = [(0.028, -0.028, 0), (-0.028, 0.028, 0), (0.028, 0.028, 0), (-0.028, -0.028, 0)]
    LIFT = 0.027 * 9.81 / 4

    def __init__(self, count, size, first=0, shadow=1):
        import pybullet
        import pybullet_data
        import PyFlyt
        from pybullet_utils.bullet_client import BulletClient

        # PyBullet brings no quadrotor; this is PyFlyt's Crazyflie.
        urdf = Path(PyFlyt.__file__).parent / "models/vehicles/cf2x/cf2x.urdf"
        self.size, self.shadow, self.worlds = size, shadow, []
        for index in range(first, first + count):
            world = BulletClient(pybullet.DIRECT)
            world.setAdditionalSearchPath(pybullet_data.getDataPath())
            world.setGravity(0, 0, -9.81)
            world.loadURDF("plane.urdf", useFixedBase=True)
            bullet_boxes(world)
            turned = pybullet.getQuaternionFromEuler((0, 0, 2 * math.pi * index / FLEET))
            craft = world.loadURDF(str(urdf), (0, 0, HEIGHT), turned)
            world.changeDynamics(craft, -1, linearDamping=0, angularDamping=0)
            world.resetBaseVelocity(craft, (0, 0, 0), (0, 0, TURN))
            self.worlds.append((world, craft))
        numpy_images(self.worlds[0][0])
        if size:
            self.projection = pybullet.computeProjectionMatrixFOV(VERTICAL_FOV, size[0] / size[1], 0.1, 255.0)

    def advance(self):
        return [self.advance_one(world, craft) for world, craft in self.worlds]

    def advance_one(self, world, craft):
        for _ in range(240 // RATE):
            for rotor in self.ROTORS:
                world.applyExternalForce(craft, -1, (0, 0, self.LIFT), rotor, world.LINK_FRAME)
            world.stepSimulation()
        position, quaternion = world.getBasePositionAndOrientation(craft)
        if self.size is None:
            return (*position, *quaternion)
        turn = world.getMatrixFromQuaternion(quaternion)
        target = [at + ahead for at, ahead in zip(position, turn[::3])]
        view = world.computeViewMatrix(position, target, turn[2::3])
        width, height = self.size
        image = world.getCameraImage(
            width, height, view, self.projection, renderer=world.ER_TINY_RENDERER, shadow=self.shadow, lightDirection=TO_SUN,
            flags=world.ER_NO_SEGMENTATION_MASK)
        return image[2].reshape(height, width, 4)

    def check(self):
        for world, craft in self.worlds:
            position, _ = world.getBasePositionAndOrientation(craft)
            if abs(position[2] - HEIGHT) > 1 or world.getContactPoints(craft):
                raise RuntimeError(f"a craft of PyBullet does not fly: {position}")

    def close(self):
        for world, _ in self.worlds:
            world.disconnect()


def bullet_boxes(world):
    for (x, y), (width, depth, height), colour in boxes():
        half = (width / 2, depth / 2, height / 2)
        shape = world.createVisualShape(world.GEOM_BOX, halfExtents=half, rgbaColor=(*colour, 1))
        solid = world.createCollisionShape(world.GEOM_BOX, halfExtents=half)
        world.createMultiBody(0, solid, shape, (x, y, height / 2))


def numpy_images(world):
    if not world.isNumpyEnabled():
        raise RuntimeError("this PyBullet was built without NumPy, so that its images are slow lists")


class HyperDrone:
    # For images; without them a batch needs no second process.
    WORKERS = True
    SUBSTEPS = 3

    def __init__(self, count, size, first=0, fidelity="medium", grid=1):
        import numpy
        from hyperdrone import dynamics

        self.size, self.output = size, None
        settings = {"dynamics": {"dynamics": {"model": "crazyflie"}, "integration": {"dt": 1 / RATE / self.SUBSTEPS}}}
        self.craft = dynamics.Sim(count, parameters=settings)
        self.craft.reset()
        body = self.craft.parameters["dynamics"]["dynamics"]
        # The command at which four rotors carry the weight: the root of their polynomial.
        lift = body["mass"] * -body["gravity"][2] / 4
        c, b, a = body["rotor_thrust_coefficients"][0]
        command = (-b + math.sqrt(b * b - 4 * a * (c - lift))) / (2 * a)
        turns = numpy.arange(first, first + count) * math.pi / FLEET
        state = self.craft.state
        state["position"] = numpy.tile([0.0, 0.0, HEIGHT], (count, 1))
        state["orientation"] = numpy.stack([numpy.cos(turns), 0 * turns, 0 * turns, numpy.sin(turns)], axis=1)
        state["angular_velocity"] = numpy.tile([0.0, 0.0, TURN], (count, 1))
        state["motor_command"] = numpy.full((count, 4), command)
        self.actions = numpy.full((count, 4), 2 * command - 1, numpy.float32)
        if size:
            import hyperlux
            from hyperlux.camera import RGB, CameraSpec

            width, height = size
            self.renderer = hyperlux.HyperLux(
                width=width, height=height, batch_size=count, num_probes=0, cameras=(CameraSpec("front", (RGB("rgba8"),)),),
                fidelity=fidelity, anti_aliasing_grid=grid)
            if self.renderer.backend != "generic":
                raise RuntimeError(f"the renderer is {self.renderer.backend}, not that of the CPU")
            self.renderer.init(self.scene())
            self.output = self.renderer.outputs[RGB("rgba8")]
            # Its angle is that of the width.
            self.fov = math.degrees(2 * math.atan(math.tan(math.radians(VERTICAL_FOV) / 2) * width / height))

    @staticmethod
    def scene():
        import hyperlux
        import numpy

        scene = hyperlux.Scene()
        ground = hyperlux.Object(name="ground")
        corners = numpy.array([(-100, -100, 0), (100, -100, 0), (100, 100, 0), (-100, 100, 0)], numpy.float32)
        ground.add_mesh(hyperlux.Mesh(corners, numpy.array([(0, 1, 2), (0, 2, 3)], numpy.int32), color=(0.5, 0.5, 0.5)))
        scene.add_object(ground)
        for (x, y), size, colour in boxes():
            house = hyperlux.primitives.box(size=size, color=colour)
            scene.add_object(house, hyperlux.make_transform(position=(x, y, size[2] / 2)))
        # Its directional lights cast no shadows, its points of light do.
        sun = tuple(1000 * v for v in TO_SUN)
        scene.add_light(hyperlux.SceneLight.point(position=sun, color=(2.0, 2.0, 1.9), attenuation=(1, 0, 0)))
        scene.set_environment(ambient=(0.4, 0.4, 0.4), background=SKY)
        return scene

    def advance(self):
        for _ in range(self.SUBSTEPS):
            self.craft.step(self.actions)
        if self.size is None:
            return self.craft.observe()
        self.renderer.set_cameras(self.craft.camera_bases(fov=self.fov, aspect=self.renderer.aspect))
        self.renderer.render()
        return self.output.read()

    def check(self):
        heights = self.craft.state["position"][:, 2]
        if abs(heights - HEIGHT).max() > 1:
            raise RuntimeError(f"a craft of hyperdrone does not fly: heights {heights}")

    def close(self):
        pass


class Halves:
    """Craft in two processes, whose images are written to shared memory."""

    # The processes stay, for what they have loaded and compiled.
    workers = []

    def __init__(self, name, count, size):
        import numpy

        if not self.workers:
            self.start()
        self.shared, self.images, place = None, None, None
        if size:
            shape = (count, size[1], size[0], 4)
            self.shared = shared_memory.SharedMemory(create=True, size=math.prod(shape))
            self.images, place = numpy.ndarray(shape, numpy.uint8, self.shared.buf), self.shared.name
        self.ask(*(("make", name, count // CORES, size, half * (count // CORES), place) for half in range(CORES)))

    @classmethod
    def start(cls):
        context = multiprocessing.get_context("spawn")
        for _ in range(CORES):
            ours, theirs = context.Pipe()
            context.Process(target=work, args=(theirs,), daemon=True).start()
            # So that the end of a process is noticed.
            theirs.close()
            cls.workers.append(ours)

    def ask(self, *whats):
        """Asks each process for something, or all for the same."""
        for pipe, what in zip(self.workers, whats if len(whats) > 1 else whats * CORES):
            pipe.send(what)
        answers = [pipe.recv() for pipe in self.workers]
        for answer in answers:
            if isinstance(answer, str):
                raise RuntimeError(answer)
        return answers

    def advance(self):
        poses = self.ask("advance")
        return poses if self.images is None else self.images

    def check(self):
        self.ask("check")

    def busy(self):
        return sum(self.ask("busy"))

    def close(self):
        self.ask("close")
        self.images = None
        if self.shared:
            self.shared.close()
            self.shared.unlink()


class Half:
    """What one of the processes of Halves holds."""

    def make(self, name, count, size, first, place):
        import numpy

        self.fleet, self.shared, self.images = alone(name, count, size, first), None, None
        if place:
            self.shared = shared_memory.SharedMemory(place)
            whole = numpy.ndarray((first + count, size[1], size[0], 4), numpy.uint8, self.shared.buf)
            self.images = whole[first:]

    def advance(self):
        import numpy

        seen = self.fleet.advance()
        if self.images is None:
            return numpy.array(seen)
        for index, image in enumerate(seen):
            self.images[index] = image
        return None

    def check(self):
        self.fleet.check()

    def busy(self):
        return busy()

    def close(self):
        self.fleet.close()
        self.fleet = self.images = None
        if self.shared:
            self.shared.close()


def work(pipe):
    """One of the processes of Halves: does what it is asked for until nobody asks."""
    keep_quiet()
    half = Half()
    while True:
        try:
            what = pipe.recv()
        except EOFError:
            return
        name, *arguments = what if isinstance(what, tuple) else (what,)
        try:
            pipe.send(getattr(half, name)(*arguments))
        except Exception as error:
            pipe.send(f"{type(error).__name__}: {error}")


def alone(name, count, size, first=0):
    kind, arguments, _, _ = PROGRAMS[name]
    return globals()[kind](count, size, first, **arguments)


def fleet(name, count, size):
    kind = globals()[PROGRAMS[name][0]]
    one_batch = kind is HyperDrone and size is None
    return Halves(name, count, size) if count > 1 and kind.WORKERS and not one_batch else alone(name, count, size)


def busy():
    """CPU seconds of this process so far, all threads."""
    return sum(resource.getrusage(resource.RUSAGE_SELF)[:2])


def timed(name, count, size, seconds):
    """Steps all craft for so long; returns steps or images, and wall and CPU seconds."""
    done, wall, cpu = 0, 0.0, 0.0
    while wall < seconds:
        craft = fleet(name, count, size)
        spent = getattr(craft, "busy", lambda: 0.0)
        if size in SIZES[:2]:
            # The first step and the first image of a process compile or load.
            craft.advance()
        before, started = busy() + spent(), time.perf_counter()
        for _ in range(LONGEST):
            seen = craft.advance()
            done += count
            passed = time.perf_counter() - started
            if wall + passed >= seconds:
                break
        wall, cpu = wall + passed, cpu + busy() + spent() - before
        craft.check()
        if size:
            inspect(seen)
        craft.close()
    return {"rate": done / wall, "cores": cpu / wall}


def inspect(images):
    """A renderer that shows nothing is fast, so each image must show something."""
    import numpy

    for image in images:
        colours = len(numpy.unique((numpy.asarray(image)[..., :3] // 16) @ numpy.array([1, 16, 256])))
        if colours < 3:
            raise RuntimeError(f"a picture has {colours} colours only: nothing was drawn")


def measure(name, count, seconds):
    return [timed(name, count, size, seconds) for size in SIZES]


def compile_all(name):
    """Makes one of everything that is measured, so that what is compiled on first use lies ready."""
    for size in SIZES:
        for count in (1, FLEET // CORES, FLEET):
            if count == FLEET and size:
                continue
            alone(name, count, size).advance()


def picture(name):
    """Saves what one craft sees after a second, on its way."""
    import numpy

    craft = alone(name, 1, PICTURE)
    for _ in range(RATE):
        seen = craft.advance()
    numpy.save(WORK / f"{name}.npy", numpy.asarray(seen[0])[..., :3])


def join(names, path):
    """Pictures side by side."""
    import numpy
    from PIL import Image

    rows = [numpy.load(WORK / f"{name}.npy") for name in names]
    gap = numpy.full((PICTURE[1], 4, 3), 255, numpy.uint8)
    parts = [part for row in rows for part in (row, gap)][:-1]
    Image.fromarray(numpy.hstack(parts)).save(path)


# ---------------------------------------------------------------- all of them


def wheel(given):
    if given:
        return Path(given)
    built = sorted((ROOT / "target/wheels").glob("spf_fly-*.whl"), key=lambda path: path.stat().st_mtime)
    if not built:
        sys.exit("there is no wheel in target/wheels: build it with `.ci/release --wheel`, or give one by --wheel")
    return built[-1]


def prepare(spf_wheel):
    if not (VENV / "bin/python").exists():
        subprocess.run([sys.executable, "-m", "venv", str(VENV)], check=True)
    pip = [str(VENV / "bin/pip"), "install", "-q", "--disable-pip-version-check"]
    # One at a time, so that one that cannot be installed does not affect the others.
    for package in PACKAGES:
        subprocess.run([*pip, package], check=False)
    if spf_wheel:
        # Wheels of one version may differ.
        subprocess.run([*pip, "--force-reinstall", "--no-deps", str(spf_wheel)], check=True)
    WORK.mkdir(parents=True, exist_ok=True)
    # hyperdrone fetches from GitHub what it builds upon. Where Debian's packages of the same libraries are installed, they are taken
    # instead; the loader of scene files, which is not used here, is the only part of them that runs. Its viewer is left out.
    (WORK / "debian.cmake").write_text(
        "set(FETCHCONTENT_TRY_FIND_PACKAGE_MODE ALWAYS)\n"
        "set(CMAKE_FIND_PACKAGE_TARGETS_GLOBAL TRUE)\n"
        "set(FETCHCONTENT_SOURCE_DIR_STB /usr/include/stb)\n"
        "set(RL_TOOLS_DISABLE_CLI11 ON)\n"
        "set(RL_TOOLS_DISABLE_TENSORBOARD ON)\n"
        "set(RL_TOOLS_HYPERLUX_DISABLE_SPY ON)\n")


def environment():
    added = {
        "PATH": f"{VENV / 'bin'}{os.pathsep}{os.environ['PATH']}",
        # NumPy and hyperdrone's dynamics: the craft are few, so that threads cost more than they save.
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "HYPERLUX_BACKEND": "GENERIC",
        "HYPERLUX_CACHE_DIR": str(WORK / "hyperlux"),
        "HYPERLUX_BUILD_JOBS": str(CORES),
    }
    if Path("/usr/include/stb/stb_image.h").exists() and Path("/usr/include/assimp/scene.h").exists():
        added["CMAKE_TOOLCHAIN_FILE"] = str(WORK / "debian.cmake")
    return dict(os.environ, **added)


def run(*arguments, **more):
    """Runs a part of this script in the environment; returns its result, or the reason that there is none."""
    command = [str(VENV / "bin/python"), __file__, "--run", *map(str, arguments)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=900, env=dict(environment(), **more))
    except subprocess.TimeoutExpired:
        return None, "it took more than 15 minutes"
    line = done.stdout.strip().splitlines()[-1:] or [""]
    if done.returncode != 0 or not line[0].startswith("{"):
        lines = [line.strip() for line in done.stderr.splitlines() if line.strip()] or [f"exit code {done.returncode}"]
        # What follows an exception may be the output of CMake, which tells the cause in the line after its error.
        at = max((index for index, line in enumerate(lines) if "Error" in line), default=len(lines) - 1)
        return None, " ".join(lines[at:at + 2] if lines[at].endswith(":") else lines[at:at + 1])
    return json.loads(line[0])["result"], None


def machine():
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    model = next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), "?")
    system = f"{os.cpu_count()} cores, {platform.system()} {platform.release()}"
    return f"{model}, {system}, {time.strftime('%Y-%m-%d %H:%M')}, load {os.getloadavg()[0]:.1f}"


def number(value):
    return f"{value:.0f}" if value >= 100 else f"{value:.1f}"


def table(title, names, rows):
    columns = [f"images/s {size[0]}×{size[1]}" if size else "steps/s" for size in SIZES]
    print(f"| {title} | {' | '.join(columns)} |")
    print(f"|---|{'---|' * len(SIZES)}")
    for name in names:
        cells = ["–"] * len(SIZES)
        if name in rows:
            medians = [[statistics.median(cell[key] for cell in column) for key in ("rate", "cores")] for column in zip(*rows[name])]
            cells = [f"{number(rate)} ({cores:.1f})" for rate, cores in medians]
        print(f"| {PROGRAMS[name][2]} | {' | '.join(cells)} |")
    print()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--wheel", help="the wheel of SPF")
    parser.add_argument("--seconds", type=float, default=1.0, help="length of each measurement, at least one step")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--only", default=",".join(PROGRAMS))
    parser.add_argument("--pictures", help="an image file for what the programs draw, side by side in the order of the table")
    parser.add_argument("--quick", action="store_true", help="one round of a moment: tells whether it runs, the figures are worth nothing")
    options = parser.parse_args()
    if options.quick:
        options.seconds, options.rounds = 0.05, 1
    names = [name for name in options.only.split(",") if name]
    unknown = [name for name in names if name not in PROGRAMS]
    if unknown:
        parser.error(f"no program {', '.join(unknown)}; there are {', '.join(PROGRAMS)}")
    spf_wheel = wheel(options.wheel) if "spf" in names else None
    prepare(spf_wheel)
    results, reasons = {}, {}
    for name in names:
        if PROGRAMS[name][0] != "HyperDrone":
            continue
        _, reason = run("compile_all", name)
        if reason:
            reasons[name] = reason
        print(f"{name}: {reason or 'compiled'}", file=sys.stderr)
    started = time.monotonic()
    for _ in range(options.rounds):
        for count in (1, FLEET):
            for name in names:
                if name in reasons:
                    continue
                # What has been compiled is not looked at again.
                result, reason = run("measure", name, count, options.seconds, HYPERLUX_SKIP_BUILD="1")
                if reason:
                    reasons[name] = reason
                else:
                    results.setdefault(count, {}).setdefault(name, []).append(result)
                shown = reason or " ".join(number(cell["rate"]) for cell in result)
                print(f"{name} {count}: {shown}", file=sys.stderr)
    print(f"measured in {time.monotonic() - started:.0f} s", file=sys.stderr)
    if options.pictures:
        drawn = [name for name in names if name not in reasons and run("picture", name, HYPERLUX_SKIP_BUILD="1")[1] is None]
        _, reason = run("join", ",".join(drawn), Path(options.pictures).resolve())
        print(reason or f"{options.pictures}, from the left: {', '.join(drawn)}", file=sys.stderr)
    packages = ", ".join([*([spf_wheel.name] if spf_wheel else []), *PACKAGES[:3]])
    print(f"{machine()}; {packages}; median of {options.rounds} rounds. In brackets: cores busy.\n")
    table("one craft", names, results.get(1, {}))
    table(f"{FLEET} craft on {CORES} cores, all together", names, results.get(FLEET, {}))
    print("| program | a step of 1/30 s |\n|---|---|")
    for name in names:
        print(f"| {name} | {PROGRAMS[name][3]} |")
    for name, reason in reasons.items():
        print(f"\n`{name}` could not be run: {reason}")


def keep_quiet():
    """Lets what libraries print go to the errors, and keeps to some cores."""
    os.dup2(2, 1)
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:CORES])


if __name__ == "__main__":
    if sys.argv[1:2] == ["--run"]:
        answer = os.fdopen(os.dup(1), "w")
        keep_quiet()
        what, *rest = sys.argv[2:]
        calls = {
            "compile_all": compile_all,
            "measure": lambda name, count, seconds: measure(name, int(count), float(seconds)),
            "picture": picture,
            "join": lambda drawn, path: join(drawn.split(","), path),
        }
        print(json.dumps({"result": calls[what](*rest)}), file=answer, flush=True)
    else:
        main()
