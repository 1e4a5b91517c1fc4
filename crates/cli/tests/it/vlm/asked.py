"""Runs a command at a terminal of its own and answers its question: asked.py ANSWER COMMAND...

Prints the command's exit code, and what the terminal showed.
"""

import os
import pty
import select
import sys
import time

answer, command = sys.argv[1], sys.argv[2:]
child, terminal = pty.fork()
if child == 0:
    os.execvp(command[0], command)
shown, answered, until = b"", False, time.monotonic() + 120
while time.monotonic() < until:
    if not select.select([terminal], [], [], 1)[0]:
        continue
    try:
        part = os.read(terminal, 4096)
    except OSError:  # the command has closed its side
        break
    if not part:
        break
    shown += part
    if not answered and shown.endswith(b"[y/N] "):
        os.write(terminal, answer.encode() + b"\n")
        answered = True
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
print(shown.decode(errors="replace"))
