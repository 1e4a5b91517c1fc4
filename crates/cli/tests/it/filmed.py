"""Runs a program in a pseudo-terminal and films what it shows there: the code of a clock goes, DELAY seconds later, through ffmpeg to
an RTP address. Prints what else the program said.

    python3 filmed.py DELAY ADDRESS PROGRAM ARGUMENTS
"""

import collections
import os
import pty
import re
import select
import subprocess
import sys
import time

DELAY, ADDRESS = float(sys.argv[1]), sys.argv[2]
WIDTH, LINES, MODULE, RATE = 29, 15, 8, 15
SIZE = f"{WIDTH * MODULE + 8}x{2 * LINES * MODULE}"
DARK = {"█": (1, 1), "▀": (1, 0), "▄": (0, 1), " ": (0, 0)}
SHOWN = re.compile("\x1b\\[38;5;16;48;5;231m([█▀▄ ]*)\x1b\\[0m")

child, terminal = pty.fork()
if child == 0:
    os.execvp(sys.argv[3], sys.argv[3:])
encode = ["-c:v", "libx264", "-preset", "ultrafast", "-tune", "zerolatency", "-pix_fmt", "yuv420p", "-g", str(RATE)]
source = ["-probesize", "32", "-analyzeduration", "0", "-f", "rawvideo", "-pix_fmt", "gray", "-s", SIZE, "-r", str(RATE), "-i", "-"]
camera = subprocess.Popen(
    ["ffmpeg", "-v", "error", *source, *encode, "-f", "rtp", f"rtp://{ADDRESS}?pkt_size=1200"],
    stdin=subprocess.PIPE,
    stdout=subprocess.DEVNULL,
)


def image(lines):
    """A picture of the lines, in grey."""
    pixels = b""
    for line in lines:
        for half in (0, 1):
            row = b"".join(bytes([20 if DARK[cell][half] else 230]) * MODULE for cell in line) + bytes([230]) * 8
            pixels += row * MODULE
    return pixels


said, unread, lines = "", b"", []
shown = collections.deque([(0.0, image([" " * WIDTH] * LINES))])
due, ended = time.monotonic(), False
while not ended:
    ready, _, _ = select.select([terminal], [], [], max(0.0, due - time.monotonic()))
    if ready:
        try:
            unread += os.read(terminal, 65536)
        except OSError:
            ended = True
        *whole, unread = unread.split(b"\n")
        for line in whole:
            text = line.decode()
            found = SHOWN.search(text)
            if not found:
                said += text.replace("\r", "") + "\n"
                continue
            lines.append(found.group(1))
            if len(lines) == LINES:
                shown.append((time.monotonic(), image(lines)))
                lines = []
    if time.monotonic() >= due:
        due += 1.0 / RATE
        while len(shown) > 1 and shown[1][0] <= time.monotonic() - DELAY:
            shown.popleft()
        try:
            camera.stdin.write(shown[0][1])
            camera.stdin.flush()
        except BrokenPipeError:
            ended = True
camera.kill()
_, status = os.waitpid(child, 0)
sys.stdout.write(said)
sys.exit(os.waitstatus_to_exitcode(status))
