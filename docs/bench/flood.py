#!/usr/bin/env python3
"""Floods the ports of the Tello driver while it flies, and measures whether the flight is harmed (docs/explanation/security.md).

    python3 docs/bench/flood.py target/release/spf [--rate 100000] [--seconds 12] [--flights 2]

Flies the virtual Tello over sockets in real time, first alone, then while a process sends that many datagrams of rubbish a
second to the driver's three ports: from twenty other addresses, and from the address of the drone itself. Each flight ends by
SIGINT after some seconds, or by itself. Prints the intervals between the commands to the drone while it flies, the time from
SIGINT to zero or `land`, the memory of the flight, and how it ended. Linux only (sendmmsg).
"""
import argparse
import ctypes
import os
import random
import re
import signal
import socket
import statistics
import struct
import subprocess
import sys
import tempfile
import threading
import time

import setpoints

PORTS = [8889, 8890, 11111]
OTHERS = [f"127.0.0.{n}" for n in range(100, 120)]
BATCH = 64


def rubbish(rng):
    """A datagram that is random, or looks a little like one of a Tello."""
    real = b"mid:-1;x:0;y:0;z:0;pitch:0;roll:0;yaw:0;vgx:0;vgy:0;vgz:0;templ:60;temph:62;tof:80;h:80;bat:87;baro:12.3;time:9;"
    kind = rng.randrange(6)
    if kind == 0:
        return rng.randbytes(rng.randint(1, 1472))
    if kind == 1:
        return rng.choice([b"ok", b"error", b"87\r\n", b"out of range", b"error Motor stop", b"\xff" * 9])
    if kind == 2:
        broken = bytearray(real)
        broken[rng.randrange(len(broken))] = rng.randrange(256)
        return bytes(broken)
    if kind == 3:
        return b"\0\0\0\1" + rng.randbytes(rng.choice([20, 900, 1456]))
    if kind == 4:
        return rng.randbytes(rng.randint(1473, 9000))
    return b""


class Vector(ctypes.Structure):
    _fields_ = [("base", ctypes.c_void_p), ("length", ctypes.c_size_t)]


class Header(ctypes.Structure):
    _fields_ = [("name", ctypes.c_void_p), ("name_length", ctypes.c_uint32), ("vectors", ctypes.POINTER(Vector)),
                ("count", ctypes.c_size_t), ("control", ctypes.c_void_p), ("control_length", ctypes.c_size_t),
                ("flags", ctypes.c_int)]


class Message(ctypes.Structure):
    _fields_ = [("header", Header), ("sent", ctypes.c_uint)]


def batch(rng, keep):
    """A batch of datagrams, spread over the ports."""
    messages = (Message * BATCH)()
    for n, message in enumerate(messages):
        data = rubbish(rng)
        text = ctypes.create_string_buffer(data, max(1, len(data)))
        port = PORTS[n % len(PORTS)]
        name = ctypes.create_string_buffer(struct.pack("=H", socket.AF_INET) + struct.pack(">H", port)
                                           + socket.inet_aton(setpoints.LOCAL) + bytes(8), 16)
        vector = Vector(ctypes.cast(text, ctypes.c_void_p), len(data))
        keep += [text, name, vector]
        message.header = Header(ctypes.cast(name, ctypes.c_void_p), 16, ctypes.pointer(vector), 1, None, 0, 0)
    return messages


def flood(addresses, rate, end):
    """Sends until `end` is readable; prints how many were sent, in how many seconds."""
    sendmmsg = ctypes.CDLL(None, use_errno=True).sendmmsg
    rng, keep, socks = random.Random(0), [], []
    for address in addresses:
        sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        sock.bind((address, 0))
        socks.append(sock)
    batches = [batch(rng, keep) for _ in range(64)]
    begun, sent, n = time.monotonic(), 0, 0
    os.set_blocking(end, False)
    while True:
        due = (time.monotonic() - begun) * rate
        if sent > due:
            time.sleep((sent - due) / rate)
        # A refused datagram (no listener yet) is an error of the next call only.
        sent += max(0, sendmmsg(socks[n % len(socks)].fileno(), batches[n % len(batches)], BATCH, 0))
        n += 1
        if n % 256 == 0:
            try:
                os.read(end, 1)
                break
            except BlockingIOError:
                pass
    print(sent, time.monotonic() - begun)


def flight(spf, folder, seconds, addresses, rate):
    """Datagrams of the driver with their times, begin of the flight, time of SIGINT, memory, the flood, exit code, last line."""
    serve = [spf, "sim", "serve", "--tello", "--listen", setpoints.DRONE, "--vlm", "--scene", "office"]
    served = subprocess.Popen(serve, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    url = next(found[0] for line in served.stdout if (found := re.search(r"http://[0-9.]+:\d+", line)))
    env = {**os.environ, "OPENAI_API_KEY": "none", "SPF_TELLO_LOCAL": setpoints.LOCAL, "RUST_LOG": "warn,spf_drone=trace"}
    command = [spf, "fly", "fly to the vending machine", "--drone", f"tello@{setpoints.DRONE}", "--vlm", f"openai@{url}/v1"]
    command += ["--no-vlm-check", "--unattended", "--out", os.path.join(folder, "flight")]
    client = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=env)
    said, lines, flying, stopped, flooding, most = [], [], None, None, None, 0.0

    def stop():
        nonlocal stopped
        stopped = time.time()
        client.send_signal(signal.SIGINT)

    timer = threading.Timer(seconds, stop)
    for line in client.stderr:
        datagram = setpoints.sent(line)
        if datagram:
            said.append(datagram)
        else:
            lines.append(line.rstrip())
        if flying is None and line.rstrip().endswith(" flying"):
            flying = time.time()
            timer.start()
            if addresses:
                own = [sys.executable, os.path.abspath(__file__), "--flood", ",".join(addresses), "--rate", str(rate), spf]
                flooding = subprocess.Popen(own, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        with open(f"/proc/{client.pid}/status") as status:
            found = re.search(r"VmHWM:\s+(\d+)", status.read())
        most = max(most, int(found[1]) / 1024 if found else 0.0)
    timer.cancel()
    code = client.wait()
    sent = (0, 1.0)
    if flooding:
        out, _ = flooding.communicate("x")
        sent = tuple(map(float, out.split()))
    served.send_signal(signal.SIGINT)
    served.wait()
    return said, flying, stopped, most, sent, code, lines


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("spf")
    parser.add_argument("--rate", type=float, default=100_000.0, help="datagrams a second")
    parser.add_argument("--seconds", type=float, default=12.0)
    parser.add_argument("--flights", type=int, default=2)
    parser.add_argument("--show", action="store_true", help="what the program said")
    parser.add_argument("--flood", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.flood:
        flood(given.flood.split(","), given.rate, 0)
        return
    spf, ok = os.path.abspath(given.spf), True
    for name, addresses in (("no flood", []), ("from other addresses", OTHERS), ("from the drone's address", [setpoints.DRONE])):
        gaps, stops, most, rates, ends = [], [], 0.0, [], []
        for _ in range(given.flights):
            with tempfile.TemporaryDirectory() as folder:
                said, flying, stopped, memory, sent, code, lines = flight(spf, folder, given.seconds, addresses, given.rate)
            if given.show:
                print("\n".join(lines))
            if not flying:
                sys.exit("never flying:\n" + "\n".join(lines))
            landing = min([at for at, text in said if text == "land"], default=float("inf"))
            told = [at for at, text in said if text.startswith("rc ") and flying < at < min(landing, stopped or landing)]
            gaps += [later - earlier for earlier, later in zip(told, told[1:])]
            if stopped and stopped <= landing:
                stops.append(min(at for at, text in said if at >= stopped and text in ("rc 0 0 0 0", "land")) - stopped)
            most, rates = max(most, memory), rates + [sent[0] / sent[1]]
            ok &= landing < float("inf")
            why = "no `land`" if landing == float("inf") else f"`land` {landing - flying:.1f} s after the flood began"
            told_why = [line.split("envelope: ")[1] for line in lines if "envelope: " in line and "limited" not in line]
            ends.append(f"{why}, exit code {code}; holds and landings: {', '.join(told_why) or 'none but by SIGINT'}")
        gaps.sort()
        p99 = gaps[int(0.99 * len(gaps))]
        print(f"{name}: {given.flights} flights, {statistics.mean(rates):.0f} datagrams a second; {len(gaps)} intervals between "
              f"commands, median {1e3 * statistics.median(gaps):.0f} ms, p99 {1e3 * p99:.0f} ms, longest {1e3 * gaps[-1]:.0f} ms; "
              f"SIGINT to zero or `land` {', '.join(f'{1e3 * stop:.0f}' for stop in stops) or '-'} ms; memory {most:.0f} MiB at most")
        print("\n".join(f"  {end}" for end in ends), flush=True)
    sys.exit(0 if ok else 1)


if __name__ == "__main__":
    main()
