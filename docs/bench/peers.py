#!/usr/bin/env python3
"""Renderers without a GPU, on one machine in one hour: images per second of the same town along the same path.

    python3 docs/bench/peers.py [--frames 60] [--rounds 3] [--only NAME,NAME]

Creates its own Python environment (target/peers-venv: PyBullet, MuJoCo, moderngl), builds the example `peer` of
spf-render in the release profile, writes the city as OBJ files (target/peers-scene), and prints a Markdown table. Needs the
Debian packages libosmesa6, libegl1 and libgl1-mesa-dri. The reason for each renderer that cannot be run is printed under the table. Each
figure is the median of the rounds; rounds alternate, so that a busy minute affects all alike. Nothing else should run meanwhile.
"""

import argparse
import json
import os
import platform
import resource
import statistics
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
VENV = ROOT / "target/peers-venv"
SCENE = ROOT / "target/peers-scene"
PACKAGES = ["numpy", "pybullet==3.2.7", "mujoco==4.0.0", "moderngl==5.13.0"]
SIZES = [(960, 720), (640, 480)]

# Name → (function, keyword arguments, environment, description).
RUNS = {
    "spf": ("spf", {}, {}, "SPF `full` on both cores: procedural textures, sun shadows, ambient occlusion, haze, edges anti-aliased"),
    "spf-1": ("spf", {"threads": 1}, {}, "the same on one core"),
    "tiny": ("pybullet", {"shadow": 1}, {}, "PyBullet TinyRenderer: one colour per material, shadow pass on, no anti-aliasing"),
    "tiny-plain": ("pybullet", {"shadow": 0}, {}, "PyBullet TinyRenderer: no shadows, no anti-aliasing"),
    "mujoco": (
        "mujoco", {"shadow": True, "samples": 4}, {"MUJOCO_GL": "osmesa"},
        "MuJoCo with OSMesa: one colour per material, shadow map of 2048×2048, 4 samples requested"),
    "mujoco-plain": (
        "mujoco", {"shadow": False, "samples": 0}, {"MUJOCO_GL": "osmesa"},
        "MuJoCo with OSMesa: no shadows, no anti-aliasing"),
    "llvmpipe": (
        "llvmpipe", {"shadow": True, "samples": 4}, {"LIBGL_ALWAYS_SOFTWARE": "1", "EGL_PLATFORM": "surfaceless"},
        "Mesa llvmpipe (EGL): one colour per material, shadow map rendered once, 4 samples"),
    "llvmpipe-plain": (
        "llvmpipe", {"shadow": False, "samples": 0}, {"LIBGL_ALWAYS_SOFTWARE": "1", "EGL_PLATFORM": "surfaceless"},
        "Mesa llvmpipe: no shadows, no anti-aliasing"),
}


def scene():
    return json.loads((SCENE / "scene.json").read_text())


def timed(draw, poses, frames):
    """Renders the path once to warm up, then `frames` images of it; returns wall and CPU seconds, all threads."""
    for pose in poses[::30]:
        draw(pose)
    # Spread over the whole path.
    poses = poses[::-(-len(poses) // frames)]
    busy = lambda: sum(resource.getrusage(resource.RUSAGE_SELF)[:2])
    started, before = time.perf_counter(), busy()
    for index in range(frames):
        draw(poses[index % len(poses)])
    return {"frames": frames, "wall_s": time.perf_counter() - started, "cpu_s": busy() - before}


def keep(picture, name):
    """Writes the last image beside the scene, for inspection. A renderer that shows nothing is fast, so it must show enough."""
    import numpy

    data = numpy.ascontiguousarray(numpy.asarray(picture)[..., :3], dtype=numpy.uint8)
    (SCENE / f"{name}.ppm").write_bytes(b"P6 %d %d 255\n" % (data.shape[1], data.shape[0]) + data.tobytes())
    colours = len(numpy.unique(data.reshape(-1, 3) // 16, axis=0))
    if colours < 20:
        raise RuntimeError(f"the picture has {colours} colours only: nothing was drawn")


def target(pose):
    return [eye + ahead for eye, ahead in zip(pose["eye"], pose["ahead"])]


# ---------------------------------------------------------------- each in its own process


def spf(width, height, frames, threads=0):
    environment = dict(os.environ, **({"RAYON_NUM_THREADS": str(threads)} if threads else {}))
    command = [str(ROOT / "target/release/examples/peer"), "time", str(width), str(frames)]
    result = json.loads(subprocess.run(command, check=True, capture_output=True, text=True, env=environment).stdout)
    return result


def pybullet(width, height, frames, shadow):
    import numpy
    import pybullet as bullet

    town = scene()
    bullet.connect(bullet.DIRECT)
    for material in town["materials"]:
        shape = bullet.createVisualShape(
            bullet.GEOM_MESH, fileName=str(SCENE / material["file"]), rgbaColor=[*material["colour"], 1.0])
        bullet.createMultiBody(baseVisualShapeIndex=shape)
    projection = bullet.computeProjectionMatrixFOV(town["vertical_fov_deg"], width / height, 0.1, 1000.0)
    last = []

    def draw(pose):
        view = bullet.computeViewMatrix(pose["eye"], target(pose), [0, 0, 1])
        last[:] = bullet.getCameraImage(
            width, height, view, projection, renderer=bullet.ER_TINY_RENDERER, shadow=shadow, lightDirection=town["to_sun"],
            flags=bullet.ER_NO_SEGMENTATION_MASK)

    result = timed(draw, town["path"], frames)
    picture = numpy.asarray(last[2], dtype=numpy.uint8).reshape(height, width, 4)
    keep(picture, f"tiny-{shadow}-{width}")
    return result


def mujoco(width, height, frames, shadow, samples):
    import mujoco as mj

    town = scene()
    assets = "".join(
        f'<mesh name="m{index}" file="{material["file"]}" inertia="shell"/>' for index, material in enumerate(town["materials"]))
    numbers = lambda values: " ".join(f"{value:.5f}" for value in values)
    # A mesh is centred and aligned with its axes of inertia; MuJoCo moves the geom of a mesh back.
    geoms = "".join(
        f'<geom type="mesh" mesh="m{index}" rgba="{numbers(material["colour"])} 1" contype="0" conaffinity="0"/>'
        for index, material in enumerate(town["materials"]))
    xml = f"""<mujoco><compiler meshdir="{SCENE}"/><statistic extent="100" center="0 30 10"/>
      <visual><global offwidth="{width}" offheight="{height}" fovy="{town['vertical_fov_deg']}"/>
        <quality shadowsize="2048" offsamples="{samples}"/><map znear="0.001" zfar="10"/><headlight ambient="0.35 0.37 0.4" diffuse="0 0 0" specular="0 0 0"/></visual>
      <asset>{assets}</asset>
      <worldbody><light directional="true" castshadow="{str(shadow).lower()}" dir="{numbers(-v for v in town['to_sun'])}"
        pos="0 0 100" diffuse="0.8 0.8 0.75"/>{geoms}</worldbody></mujoco>"""
    model = mj.MjModel.from_xml_string(xml)
    data = mj.MjData(model)
    mj.mj_forward(model, data)
    import math

    renderer = mj.Renderer(model, height=height, width=width)
    camera = mj.MjvCamera()
    camera.type = mj.mjtCamera.mjCAMERA_FREE
    last = []

    def draw(pose):
        ahead = pose["ahead"]
        camera.lookat[:] = target(pose)
        camera.distance = 1.0
        camera.azimuth = math.degrees(math.atan2(ahead[1], ahead[0]))
        camera.elevation = math.degrees(math.asin(ahead[2]))
        renderer.update_scene(data, camera)
        renderer.scene.flags[mj.mjtRndFlag.mjRND_SHADOW] = shadow
        last[:] = [renderer.render()]

    result = timed(draw, town["path"], frames)
    keep(last[0], f"mujoco-{shadow}-{width}")
    return result


def llvmpipe(width, height, frames, shadow, samples):
    import moderngl
    import numpy

    town = scene()
    context = moderngl.create_context(standalone=True, backend="egl")
    if "llvmpipe" not in context.info["GL_RENDERER"]:
        raise RuntimeError(f"the renderer is {context.info['GL_RENDERER']}, not llvmpipe")
    corners = numpy.concatenate([read_obj(SCENE / material["file"], material["colour"]) for material in town["materials"]])
    buffer = context.buffer(corners.astype("f4").tobytes())
    head = "#version 330\nuniform mat4 sun_matrix; uniform mat4 matrix; in vec3 at; in vec3 normal; in vec3 colour;"
    program = context.program(
        vertex_shader=head + """out vec3 n; out vec3 c; out vec4 s;
            void main() { gl_Position = matrix * vec4(at, 1); s = sun_matrix * vec4(at, 1); n = normal; c = colour; }""",
        fragment_shader="""#version 330
            uniform vec3 to_sun; uniform bool shadowed; uniform sampler2DShadow map; in vec3 n; in vec3 c; in vec4 s; out vec4 o;
            void main() {
                vec3 p = s.xyz / s.w * 0.5 + 0.5;
                float lit = shadowed ? texture(map, vec3(p.xy, p.z - 0.001)) : 1.0;
                vec3 m = normalize(n);
                vec3 light = lit * max(dot(m, to_sun), 0) * vec3(0.8, 0.8, 0.75) + mix(0.25, 0.45, m.z * 0.5 + 0.5);
                o = vec4(c * light, 1);
            }""")
    vertices = context.vertex_array(program, [(buffer, "3f 3f 3f", "at", "normal", "colour")])
    context.enable(moderngl.DEPTH_TEST)
    size = 2048
    depth = context.depth_texture((size, size))
    depth.compare_func = "<="
    program["to_sun"] = tuple(town["to_sun"])
    program["shadowed"] = shadow
    sun = orthographic(200.0, 0.1, 600.0) @ look([300 * v for v in town["to_sun"]], [-v for v in town["to_sun"]], numpy)
    write = lambda name, matrix: program[name].write(matrix.T.astype("f4").tobytes()) if name in program else None
    write("sun_matrix", sun)
    if shadow:
        shade = context.program(
            vertex_shader="#version 330\nuniform mat4 matrix; in vec3 at; void main() { gl_Position = matrix * vec4(at, 1); }",
            fragment_shader="#version 330\nvoid main() {}")
        shade["matrix"].write(sun.T.astype("f4").tobytes())
        map_buffer = context.framebuffer(depth_attachment=depth)
        map_buffer.use()
        map_buffer.clear(depth=1.0)
        context.vertex_array(shade, [(buffer, "3f 24x", "at")]).render()
    depth.use(0)
    simple = context.framebuffer([context.renderbuffer((width, height), 3)], context.depth_renderbuffer((width, height)))
    drawn = simple
    if samples:
        drawn = context.framebuffer(
            [context.renderbuffer((width, height), 3, samples=samples)],
            context.depth_renderbuffer((width, height), samples=samples))
    projection = perspective(town["vertical_fov_deg"], width / height, 0.1, 1000.0)
    pixels = bytearray(width * height * 3)

    def draw(pose):
        drawn.use()
        drawn.clear(0.62, 0.72, 0.82, depth=1.0)
        write("matrix", projection @ look(pose["eye"], pose["ahead"], numpy))
        vertices.render()
        if drawn is not simple:
            context.copy_framebuffer(simple, drawn)
        simple.read_into(pixels, components=3, alignment=1)

    result = timed(draw, town["path"], frames)
    picture = numpy.frombuffer(bytes(pixels), dtype=numpy.uint8).reshape(height, width, 3)[::-1]
    keep(picture, f"llvmpipe-{shadow}-{width}")
    return result


def read_obj(path, colour):
    """Corners of all triangles, one row each: place, normal, colour."""
    import numpy

    places, normals, corners = [], [], []
    for line in path.read_text().splitlines():
        key, *values = line.split()
        if key == "v":
            places.append([float(value) for value in values])
        elif key == "vn":
            normals.append([float(value) for value in values])
        elif key == "f":
            corners += [int(value.split("//")[0]) - 1 for value in values]
    colours = numpy.tile(colour, (len(corners), 1))
    return numpy.hstack([numpy.array(places)[corners], numpy.array(normals)[corners], colours])


def look(eye, ahead, numpy):
    right = numpy.cross(ahead, [0.0, 0.0, 1.0])
    right /= numpy.linalg.norm(right)
    up = numpy.cross(right, ahead)
    turn = numpy.array([right, up, [-v for v in ahead]])
    matrix = numpy.eye(4)
    matrix[:3, :3] = turn
    matrix[:3, 3] = -turn @ numpy.array(eye)
    return matrix


def perspective(vertical_deg, aspect, near, far):
    import math

    import numpy

    f = 1.0 / math.tan(math.radians(vertical_deg) / 2)
    depth = near - far
    return numpy.array([[f / aspect, 0, 0, 0], [0, f, 0, 0], [0, 0, (far + near) / depth, 2 * far * near / depth], [0, 0, -1, 0]])


def orthographic(half, near, far):
    import numpy

    return numpy.array([[1 / half, 0, 0, 0], [0, 1 / half, 0, 0], [0, 0, -2 / (far - near), -(far + near) / (far - near)], [0, 0, 0, 1]])


# ---------------------------------------------------------------- all of them


def prepare():
    if not (VENV / "bin/python").exists():
        subprocess.run([sys.executable, "-m", "venv", str(VENV)], check=True)
    # One at a time, so that one that cannot be installed does not affect the others.
    for package in PACKAGES:
        subprocess.run([str(VENV / "bin/pip"), "install", "-q", "--disable-pip-version-check", package], check=False)
    build = ["cargo", "build", "--release", "--quiet", "-p", "spf-render", "--features", "figures", "--example", "peer"]
    subprocess.run(build, check=True, cwd=ROOT)
    subprocess.run([str(ROOT / "target/release/examples/peer"), "export", str(SCENE)], check=True)


def run(name, width, height, frames):
    _, _, environment, _ = RUNS[name]
    command = [str(VENV / "bin/python"), __file__, "--run", name, str(width), str(height), str(frames)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=900, env=dict(os.environ, **environment))
    except subprocess.TimeoutExpired:
        return None, "it took more than 15 minutes"
    line = done.stdout.strip().splitlines()[-1:] or [""]
    if done.returncode != 0 or not line[0].startswith("{"):
        return None, (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
    return json.loads(line[0]), None


def machine():
    model = next((line.split(":")[1].strip() for line in Path("/proc/cpuinfo").read_text().splitlines() if line.startswith("model name")), "?")
    return f"{model}, {os.cpu_count()} cores, {platform.system()} {platform.release()}, {time.strftime('%Y-%m-%d %H:%M')}, load {os.getloadavg()[0]:.1f}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--only", default=",".join(RUNS))
    options = parser.parse_args()
    names = [name for name in options.only.split(",") if name]
    unknown = [name for name in names if name not in RUNS]
    if unknown:
        parser.error(f"no run {', '.join(unknown)}; there are {', '.join(RUNS)}")
    prepare()
    results, reasons = {}, {}
    for _ in range(options.rounds):
        for width, height in SIZES:
            for name in names:
                if name in reasons:
                    continue
                result, reason = run(name, width, height, options.frames)
                if reason:
                    reasons[name] = reason
                else:
                    results.setdefault((name, width), []).append(result)
                print(f"{name} {width}x{height}: {reason or round(result['frames'] / result['wall_s'], 1)}", file=sys.stderr)
    print(f"{machine()}; {scene()['triangles']} triangles, {options.frames} pictures, median of {options.rounds} rounds.\n")
    print("| renderer and what it draws | 960×720: pictures/s | CPU time a picture | 640×480: pictures/s | CPU time a picture |")
    print("|---|---|---|---|---|")
    for name in names:
        cells = []
        for width, _ in SIZES:
            rows = results.get((name, width))
            if not rows:
                cells += ["–", "–"]
                continue
            cells.append(f"{statistics.median(row['frames'] / row['wall_s'] for row in rows):.1f}")
            cells.append(f"{1000 * statistics.median(row['cpu_s'] / row['frames'] for row in rows):.1f} ms")
        label = RUNS[name][3] if not name.startswith("spf") else f"SPF: {RUNS[name][3]}"
        print(f"| {label} | {' | '.join(cells)} |")
    for name, reason in reasons.items():
        print(f"\n`{name}` could not be run: {reason}")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--run"]:
        name, width, height, frames = sys.argv[2], *map(int, sys.argv[3:6])
        function, arguments, _, _ = RUNS[name]
        print(json.dumps(globals()[function](width, height, frames, **arguments)))
    else:
        main()
