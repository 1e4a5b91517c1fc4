"""Runs a program in a pseudo-terminal and answers its queries as a person would: the second one after `argv[1]` seconds.

Prints what the program showed, as one line per output line with the seconds since its start in front.
"""

import os
import pty
import re
import sys
import threading
import time

ANSWERS = [(0.5, "0.5 0.5 3"), (float(sys.argv[1]), "0.5 0.5 3"), (0.5, "done"), (0.5, "done")]
child, terminal = pty.fork()
if child == 0:
    os.execvp(sys.argv[2], sys.argv[2:])
began, rest, asked = time.monotonic(), b"", 0


def answer(wait, words):
    time.sleep(wait)
    os.write(terminal, words.encode() + b"\n")


while True:
    try:
        rest += os.read(terminal, 65536)
    except OSError:
        break
    # The live line is ended by a carriage return only.
    *lines, rest = re.split(rb"[\r\n]+", rest)
    for line in lines:
        print(f"{time.monotonic() - began:6.1f} {line.decode(errors='replace')}")
        wait, words = 0.0, ""
        if re.search(rb"query \d+: .*\.jpg", line):
            wait, words = ANSWERS[asked] if asked < len(ANSWERS) else (0.5, "land")
            asked += 1
        elif b"hovering for up to 60 s: type `land`" in line:
            wait, words = 1.0, "land"
        if words:
            threading.Thread(target=answer, args=(wait, words), daemon=True).start()
_, status = os.waitpid(child, 0)
sys.exit(os.waitstatus_to_exitcode(status))
