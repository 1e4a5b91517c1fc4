"""Flies `spf fly --realtime` by hand in a pseudo-terminal: types an instruction, holds a key, lets go, lands."""

import os
import pty
import select
import sys
import time

child, terminal = pty.fork()
if child == 0:
    os.execvp(sys.argv[1], sys.argv[1:])
said = b""


def read(seconds, until=None):
    """Reads what it says for so long, or until it says something."""
    global said
    end = time.time() + seconds
    while time.time() < end and not (until and until in said):
        if select.select([terminal], [], [], 0.05)[0]:
            try:
                said += os.read(terminal, 65536)
            except OSError:
                return False
    return until is None or until in said


def end(code, why):
    sys.stdout.write(said.decode(errors="replace") + f"\n{why}\n")
    sys.exit(code)


if not read(120, b" flying"):
    end(1, "it never flew")
os.write(terminal, b"\r")
for letter in b"let the towel wait, well left of the steel wall: e e e":
    os.write(terminal, bytes([letter]))
    read(0.02)
os.write(terminal, b"\x1b")
read(0.5)
sys.stdout.write("typed until here\n")
for _ in range(40):
    os.write(terminal, b"d")
    read(0.05)
read(3)
os.write(terminal, b"l")
while read(1):
    pid, status = os.waitpid(child, os.WNOHANG)
    if pid:
        end(0, f"exit {os.waitstatus_to_exitcode(status)}")
end(0, "closed")
