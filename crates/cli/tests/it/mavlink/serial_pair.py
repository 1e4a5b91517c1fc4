"""Two serial ports that are connected to each other; prints their names, and ends with its standard input."""

import os
import select
import sys
import tty

ends = [os.openpty() for _ in range(2)]
for _, port in ends:
    tty.setraw(port)
print(*(os.ttyname(port) for _, port in ends), flush=True)
masters = [master for master, _ in ends]
while True:
    ready, _, _ = select.select([*masters, sys.stdin], [], [])
    if sys.stdin in ready and not sys.stdin.read(1):
        break
    for master in ready:
        if master in masters:
            data = os.read(master, 4096)
            os.write(masters[1 - masters.index(master)], data)
