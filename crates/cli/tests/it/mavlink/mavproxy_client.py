"""MAVProxy's console, unmodified, flies a vehicle by its commands; the last line is what it has shown, as JSON.

Arguments: address (tcp:HOST:PORT or udpin:HOST:PORT), and px4 or ardupilot.
"""

import json
import os
import pty
import re
import subprocess
import sys
import tempfile
import threading
import time

address, autopilot = sys.argv[1:3]
program = os.path.join(os.path.dirname(sys.executable), "mavproxy.py")
folder = tempfile.mkdtemp()
master, slave = pty.openpty()
console = subprocess.Popen(
    [sys.executable, program, f"--master={address}", f"--state-basedir={folder}", "--nowait"],
    stdin=slave, stdout=slave, stderr=slave, cwd=folder, env={**os.environ, "HOME": folder, "TERM": "dumb"}, start_new_session=True,
)
os.close(slave)
shown, seen = [], {}


def listen():
    while True:
        try:
            data = os.read(master, 4096)
        except OSError:
            return
        if not data:
            return
        shown.append(data.decode(errors="replace"))


threading.Thread(target=listen, daemon=True).start()


def text():
    return "".join(shown)


def wait(pattern, seconds, since=0):
    """Whether a pattern is shown within a time, after a place in what was shown."""
    until = time.time() + seconds
    while time.time() < until:
        if re.search(pattern, text()[since:]):
            return True
        time.sleep(0.1)
    return False


def say(words):
    since = len(text())
    os.write(master, (words + "\n").encode())
    return since


def until(words, pattern, tries, seconds):
    """Gives a command until a pattern is shown."""
    for _ in range(tries):
        if wait(pattern, seconds, say(words)):
            return True
    return False


def height():
    for _ in range(5):
        since = say("status GLOBAL_POSITION_INT")
        if wait(r"relative_alt : -?\d+", 3, since):
            return int(re.search(r"relative_alt : (-?\d+)", text()[since:]).group(1)) / 1000
    return None


try:
    seen["connected"] = wait(r"Detected vehicle|online system", 30)
    seen["parameters"] = wait(r"Received \d+ parameters", 30)
    if autopilot == "ardupilot":
        seen["guided"] = until("mode GUIDED", r"Mode GUIDED|GUIDED>", 5, 4)
        seen["armed"] = until("arm throttle", r"ARMED", 5, 4)
        say("takeoff 4")
        time.sleep(8)
        seen["height_m"] = height()
        seen["landing"] = until("mode LAND", r"Mode LAND|LAND>", 5, 4)
        seen["disarmed"] = wait(r"DISARMED", 60)
finally:
    console.kill()
    if "--show" in sys.argv or not seen.get("connected"):
        print(text())
print(json.dumps(seen))
