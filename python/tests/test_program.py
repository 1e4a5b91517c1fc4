"""Real drones, flown by the program: here a virtual Tello, at the ports of a real one."""

import os
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

import PIL.Image
import pytest

import spf
from spf._program import _Foreground, program

# The VLM of the virtual Tello answers about its frames alone.
UNCHECKED = ["--no-vlm-check"]


@pytest.fixture
def tello(tmp_path: Path) -> Iterator[tuple[str, str]]:
    """Address and VLM of a virtual Tello in the office."""
    # An address of its own, for runs beside each other.
    own = f"127.{os.getpid() % 200 + 20}.{time.monotonic_ns() // 1000 % 250}.1"
    command = [program(), "sim", "serve", "--tello", "--scene", "office", "--listen", own, "--vlm", "--quality", "draft"]
    with (tmp_path / "served.txt").open("w") as told:
        server = subprocess.Popen(command, stdout=told, stderr=subprocess.STDOUT)
    try:
        for _ in range(600):
            lines = (tmp_path / "served.txt").read_text().splitlines()
            drone = next((line for line in lines if line.startswith("tello@")), None)
            vlm = next((line for line in lines if line.startswith("http://") and "#" in line), None)
            if drone and vlm:
                break
            assert server.poll() is None, lines
            time.sleep(0.1)
        assert drone and vlm, lines
        yield drone, vlm
    finally:
        server.terminate()
        server.wait()


def test_without_a_terminal_a_real_drone_is_refused(tello: tuple[str, str], tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    drone, vlm = tello
    with pytest.raises(spf.UsageError, match="was not flown"):
        spf.fly("fly to the door", drone=drone, vlm=vlm, out=tmp_path / "flight")
    assert "--unattended" in capfd.readouterr().err
    assert not (tmp_path / "flight").exists()


def test_unattended_it_flies_and_an_interrupt_lands(tello: tuple[str, str], tmp_path: Path) -> None:
    drone, vlm = tello
    out = tmp_path / "flight"
    flight = spf.fly("fly to the door", drone=drone, vlm=vlm, unattended=True, max_time_s=12, flags=UNCHECKED, out=out)
    assert flight.summary["drone"].startswith("tello") and len(flight.decisions) > 0, flight.summary
    assert flight.verified is None and flight.log_path.exists()
    # As a notebook's kernel interrupts, without a terminal.
    script = f"import spf; spf.fly('fly to the door', drone={drone!r}, vlm={vlm!r}, unattended=True, flags={UNCHECKED!r}, out={str(tmp_path / 'cut')!r})"
    child = subprocess.Popen([sys.executable, "-c", script], stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True)
    log = tmp_path / "cut" / "flight.mcap"
    for _ in range(600):
        if log.exists():
            break
        time.sleep(0.1)
    time.sleep(3)
    os.kill(child.pid, signal.SIGINT)
    _, told = child.communicate(timeout=60)
    assert b"KeyboardInterrupt" in told
    summary = spf.read_log(log).summary
    assert summary is not None and summary["outcome"] == "aborted"


def test_images_are_asked_about(tmp_path: Path) -> None:
    image = tmp_path / "frame.png"
    PIL.Image.fromarray(spf.Simulator("office", size=(64, 48)).observe().rgb).save(image)
    answers = tmp_path / "answers.py"
    answers.write_text("""import json, sys
for line in sys.stdin:
    reply = {"status": "navigating", "target": "door", "point": [32, 24], "depth": 4}
    print(json.dumps({"id": json.loads(line)["id"], "text": json.dumps(reply)}), flush=True)
""")
    [picture] = spf.ground([image], "the door", vlm=f"exec:{sys.executable} {answers}", out=tmp_path / "grounded")
    assert picture["picture"].endswith("frame.png") and Path(picture["annotated"]).exists()
    [answer] = picture["answers"]
    assert answer["said"]["reply"]["target"] == "door"
    with pytest.raises(spf.UsageError, match="oracl"):
        spf.ground([image], "the door", vlm="oracl")


class Alarm(Exception):
    """Of another signal's handler."""


def test_whatever_is_raised_the_program_lands_before_it_goes_on(tmp_path: Path) -> None:
    ready, landed = tmp_path / "ready", tmp_path / "landed"
    # A program that takes a moment to land.
    lands = f"""import pathlib, signal, sys, time
def land(*_):
    time.sleep(0.5)
    pathlib.Path({str(landed)!r}).touch()
    sys.exit(5)
signal.signal(signal.SIGINT, land)
pathlib.Path({str(ready)!r}).touch()
time.sleep(300)
"""

    def alarm(*_: object) -> None:
        raise Alarm

    def alarms() -> None:
        while not ready.exists():
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGALRM)

    before = signal.signal(signal.SIGALRM, alarm)
    thread = threading.Thread(target=alarms)
    try:
        with pytest.raises(Alarm), _Foreground() as foreground:
            thread.start()
            foreground.run([sys.executable, "-c", lands], dict(os.environ))
    finally:
        thread.join()
        signal.signal(signal.SIGALRM, before)
    assert landed.exists() and foreground.child is not None and foreground.child.poll() == 5


def test_functions_are_for_the_simulator() -> None:
    with pytest.raises(spf.UsageError, match="without functions"):
        spf.fly("fly", drone="tello", policy=lambda _: spf.Done())
    with pytest.raises(spf.UsageError, match="real drones"):
        spf.fly("fly", unattended=True)


@pytest.mark.skipif(sys.platform == "win32", reason="terminals of Unix")
def test_in_a_terminal_the_program_has_the_keys_and_ctrl_c_lands(tello: tuple[str, str], tmp_path: Path) -> None:
    import pty

    drone, vlm = tello
    out = tmp_path / "flight"
    script = (
        f"import os, spf; flight = spf.fly('fly to the door', drone={drone!r}, vlm={vlm!r}, flags={UNCHECKED!r}, out={str(out)!r});"
        "print('ended', flight.outcome, os.tcgetpgrp(0) == os.getpgrp())"
    )
    child, terminal = pty.fork()
    if child == 0:
        os.execv(sys.executable, [sys.executable, "-c", script])
    told, pressed, end = b"", False, time.monotonic() + 90
    while time.monotonic() < end:
        if not select.select([terminal], [], [], 1)[0]:
            continue
        try:
            told += os.read(terminal, 4096)
        except OSError:
            break
        if not pressed and (out / "flight.mcap").exists() and b"decision" in told:
            pressed = True
            os.write(terminal, b"\x03")
    if time.monotonic() >= end:
        os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    assert pressed and b"ended aborted True" in told, told.decode(errors="replace")
    assert b"KeyboardInterrupt" not in told


def test_the_licences_of_others_come_along() -> None:
    files = [file for file in metadata.files("spf-fly") or [] if file.name == "LICENSE-THIRD-PARTY"]
    assert len(files) == 1
    text = files[0].read_text()
    # The module's own binding, the program's video, and the text of one that asks for it.
    assert "\npyo3 " in text and "\nopenh264-sys2 " in text and "Cisco Systems" in text
