#!/usr/bin/env python3
"""Attacks what listens, and measures whether anybody else is harmed (docs/explanation/security.md).

    python3 docs/bench/doors.py target/release/spf [--minutes 30] [--seed 0]
    python3 docs/bench/doors.py target/release/spf --flying 100 [--flights 3]

The first form starts the VLM endpoint, the scene view and the virtual Tello, and sends them what a stranger may: slow and
silent connections, oversized and broken requests, other hosts and origins, image and JSON bombs, WebSocket floods, datagrams.
Meanwhile a well-behaved client asks each server once a second. It prints what was tried and what came back, the longest answer
to the well-behaved client, and the memory of each process. The second form measures the intervals between the stick commands of
flights, without and with that many slow or oversized connections to the endpoint and the live view, and datagrams of others to
the driver's ports.
"""
import argparse
import base64
import collections
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
import urllib.request
import zlib

import setpoints


def memory(pid):
    """Resident memory now and at most, MiB."""
    with open(f"/proc/{pid}/status") as status:
        text = status.read()
    return [int(re.search(rf"{key}:\s+(\d+)", text)[1]) / 1024 for key in ("VmRSS", "VmHWM")]


def png(width, height, data=b""):
    """A PNG that claims a size."""
    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(data, 9)) + chunk(b"IEND", b"")


def question(image):
    """A request of OpenAI's chat API about an image."""
    text = base64.b64encode(image).decode()
    return ('{"model":"m","messages":[{"role":"user","content":[{"type":"image_url","image_url":{"url":"data:image/png;base64,'
            + text + '"}},{"type":"text","text":"go"}]}]}').encode()


def http(host, path="/", method="GET", headers=(), body=b"", length=None):
    """A request as bytes."""
    lines = [f"{method} {path} HTTP/1.1", f"Host: {host}", *headers]
    if body or length is not None:
        lines.append(f"Content-Length: {len(body) if length is None else length}")
    return "\r\n".join(lines).encode() + b"\r\n\r\n" + body


WS = ("Connection: Upgrade", "Upgrade: websocket", "Sec-WebSocket-Version: 13", "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==")


def frame(payload, opcode=1, final=True):
    """A masked WebSocket frame."""
    length = len(payload)
    size = bytes([0x80 | length]) if length < 126 else bytes([0xFE]) + struct.pack(">H", length) if length < 65536 \
        else bytes([0xFF]) + struct.pack(">Q", length)
    return bytes([opcode | (0x80 if final else 0)]) + size + b"\0\0\0\0" + payload


def requests(address):
    """What can be sent as one piece."""
    port, at = address[1], f"{address[0]}:{address[1]}"
    return [
        ("another host", http("rebound.example")),
        ("two hosts", http(at, headers=["Host: evil.example"])),
        ("host 0.0.0.0", http(f"0.0.0.0:{port}")),
        ("another origin", http(at, headers=["Origin: https://evil.example"])),
        ("origin null", http(at, "/v1/chat/completions", "POST", ["Origin: null"], b"{}")),
        ("a preflight", http(at, "/pose", "OPTIONS", ["Origin: https://e.example", "Access-Control-Request-Method: PUT"])),
        ("an image of another page", http(at, "/frame.jpg", headers=["Sec-Fetch-Site: cross-site", "Sec-Fetch-Dest: image"])),
        ("WebSocket of another page", http(at, "/socket", headers=[*WS, "Origin: https://evil.example"])),
        ("length of 9 MiB", http(at, "/v1/chat/completions", "POST", length=9 << 20)),
        ("length beyond 64 bits", http(at, "/pose", "PUT", length=1 << 70)),
        ("length -1", http(at, "/pose", "PUT", length=-1)),
        ("head of 100 kB", http(at, "/" + "x" * 100_000)),
        ("200 headers", http(at, headers=[f"X-{n}: y" for n in range(200)])),
        ("two lengths", http(at, "/pose", "PUT", ["Content-Length: 1"], b"0,0,5,0")),
        ("length and chunks", http(at, "/pose", "PUT", ["Transfer-Encoding: chunked"], b"0\r\n\r\nGET / HTTP/1.1")),
        ("path outside", http(at, "/../../../../etc/passwd")),
        ("PNG of 100000 x 100000", http(at, "/v1/chat/completions", "POST", body=question(png(100_000, 100_000)))),
        ("PNG of 5000 x 5000", http(at, "/v1/chat/completions", "POST", body=question(png(5000, 5000, bytes(5000 * 15001))))),
        ("PNG of 3900 x 3900", http(at, "/v1/chat/completions", "POST", body=question(png(3900, 3900, bytes(3900 * 11701))))),
        ("JSON nested 1 million deep", http(at, "/v1/chat/completions", "POST", body=b"[" * 1_000_000)),
        ("JSON of 2 million numbers", http(at, "/v1/chat/completions", "POST", body=b"[" + b"0," * 2_000_000 + b"0]")),
        ("a pose that is no number", http(at, "/pose", "PUT", body=b"nan,inf,1e999,0")),
        ("TLS", bytes.fromhex("16030100a5010000a1") + os.urandom(160)),
        ("HTTP/2", b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"),
    ]


class Stranger:
    """Everything that is tried, each on a connection of its own."""

    def __init__(self, address, seed, stop, plain=()):
        self.host, self.port = address
        self.at = f"{address[0]}:{address[1]}"
        self.rng, self.stop, self.plain = random.Random(seed), stop, plain
        self.tried = collections.Counter()

    def talk(self, kind, data, wait=2.0):
        """Sends bytes, and counts what comes back."""
        answer = "closed"
        try:
            with socket.create_connection((self.host, self.port), timeout=wait) as sock:
                try:
                    sock.sendall(data)
                    back = sock.recv(4096)
                    found = re.match(rb"HTTP/1.1 (\d+)", back)
                    answer = found[1].decode() if found else "other bytes" if back else "closed"
                except socket.timeout:
                    answer = "no answer"
        except OSError:
            pass
        self.tried[kind, answer] += 1

    def slow(self):
        """A header, byte by byte, for as long as it is let."""
        begun = time.time()
        try:
            with socket.create_connection((self.host, self.port), timeout=5) as sock:
                for byte in b"GET / HTTP/1.1\r\nX-Slow: " + b"x" * 600:
                    if self.stop.is_set():
                        return
                    sock.sendall(bytes([byte]))
                    time.sleep(0.1)
        except OSError:
            pass
        self.tried["slow header", "cut off within 6 s" if time.time() - begun < 6 else "held longer"] += 1

    def slow_body(self):
        """A body that comes a byte at a time."""
        begun = time.time()
        try:
            with socket.create_connection((self.host, self.port), timeout=5) as sock:
                sock.sendall(http(self.at, "/v1/chat/completions", "POST", length=1000))
                for _ in range(600):
                    if self.stop.is_set():
                        return
                    sock.sendall(b"x")
                    time.sleep(0.1)
        except OSError:
            pass
        self.tried["slow body", "cut off within 22 s" if time.time() - begun < 22 else "held longer"] += 1

    def oversized(self):
        """A body without end."""
        sent = 0
        try:
            with socket.create_connection((self.host, self.port), timeout=5) as sock:
                head = http(self.at, "/v1/chat/completions", "POST", ["Transfer-Encoding: chunked"])
                sock.sendall(head)
                while sent < 64 << 20 and not self.stop.is_set():
                    sock.sendall(b"10000\r\n" + b"x" * 65536 + b"\r\n")
                    sent += 65536
        except OSError:
            pass
        self.tried["body without end", "cut off before 32 MiB" if sent < 32 << 20 else "taken"] += 1

    def flood(self):
        """Messages over a WebSocket, if one is opened."""
        try:
            with socket.create_connection((self.host, self.port), timeout=5) as sock:
                sock.sendall(http(self.at, "/socket", headers=WS))
                back = sock.recv(4096)
                if b" 101 " in back:
                    for _ in range(self.rng.randrange(200)):
                        sock.sendall(self.rng.choice([
                            frame(b"{"), frame(b"x" * 4000), frame(bytes(70000)), frame(b"x", 1, False), frame(b"", 9),
                            frame(b'{"type":"shown","frame":99999999999}'), frame(b'{"type":"scene","name":"../../etc/passwd"}'),
                            frame(b'{"type":"turn","yaw_deg":1e308,"pitch_deg":-1e308}'), self.rng.randbytes(50),
                        ]))
                    self.tried["WebSocket flood", "sent"] += 1
                    return
        except OSError:
            self.tried["WebSocket flood", "cut off"] += 1
            return
        self.tried["WebSocket flood", "not opened"] += 1

    def run(self):
        """Tries one thing after another until told to stop."""
        rng = self.rng
        plain = self.plain
        while not self.stop.is_set():
            choice = rng.random()
            if choice < 0.1:
                self.slow()
            elif choice < 0.13:
                self.slow_body()
            elif choice < 0.16:
                self.oversized()
            elif choice < 0.25:
                self.flood()
            elif choice < 0.35:
                self.talk("random bytes", rng.randbytes(rng.randrange(1, 4000)))
            elif choice < 0.5:
                _, data = rng.choice(plain)
                data = bytearray(data[:20_000])
                for _ in range(rng.randrange(1, 8)):
                    data[rng.randrange(len(data))] = rng.randrange(256)
                self.talk("a request with broken bytes", bytes(data))
            else:
                self.talk(*rng.choice(plain))


def datagrams(target, seed, stop, tried, source=None):
    """Random, long and half-right datagrams, a thousand a second."""
    rng = random.Random(seed)
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    if source:
        sock.bind((source, 0))
    words = [b"command", b"takeoff", b"rc 100 100 100 100", b"rc 9999999999 0 0 0", b"emergency", b"go 500 500 500 100", b"\xff" * 60000,
             b"h:-500;bat:0;vgx:9999999;", b"ok", b"error", b"\0\0\0\1\x67" + bytes(1455), b"speed?"]
    while not stop.is_set():
        for _ in range(10):
            data = rng.choice(words) if rng.random() < 0.5 else rng.randbytes(rng.randrange(1500))
            for port in target[1]:
                try:
                    sock.sendto(data, (target[0], port))
                    tried["datagrams", f"to {target[0]}:{port}"] += 1
                except OSError:
                    pass
        time.sleep(0.01)


def start(command):
    """A command that serves, and the address that it prints."""
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    found = re.search(r"([0-9.]+):(\d+)", process.stdout.readline())
    return process, (found[1], int(found[2]))


def besiege(spf, minutes, seed):
    """The first form."""
    stop = threading.Event()
    serve = start([spf, "sim", "serve", "--vlm", "--scene", "office"])
    tello = start([spf, "sim", "serve", "--tello", "--listen", "127.0.0.92", "--scene", "office"])
    view = start([spf, "sim", "view", "--listen", "127.0.0.1:0"])
    plain = [requests(serve[1]), requests(view[1])]
    strangers = [Stranger((serve, view)[n % 2][1], seed + n, stop, plain[n % 2]) for n in range(16)]
    threads = [threading.Thread(target=stranger.run) for stranger in strangers]
    udp = collections.Counter()
    threads.append(threading.Thread(target=datagrams, args=(("127.0.0.92", [8889]), seed, stop, udp)))
    for thread in threads:
        thread.start()
    waits, failed, begun = collections.defaultdict(list), collections.Counter(), time.time()
    urls = {"endpoint": f"http://{serve[1][0]}:{serve[1][1]}/frame.jpg", "view": f"http://{view[1][0]}:{view[1][1]}/"}
    while time.time() - begun < 60 * minutes:
        for name, url in urls.items():
            at = time.time()
            try:
                with urllib.request.urlopen(url, timeout=30) as answer:
                    answer.read()
                waits[name].append(time.time() - at)
            except OSError as error:
                failed[name, getattr(error, "code", type(error).__name__)] += 1
        time.sleep(1)
    servers = {"endpoint": serve[0], "Tello": tello[0], "view": view[0]}
    peaks = {name: memory(process.pid) for name, process in servers.items()}
    alive = [process.poll() is None for process in servers.values()]
    stop.set()
    for thread in threads:
        thread.join()
    for process in servers.values():
        process.send_signal(signal.SIGINT)
    codes = [process.wait() for process in servers.values()]
    total = sum((stranger.tried for stranger in strangers), udp)
    print(f"{minutes:g} minutes, {sum(total.values())} attempts, seed {seed}")
    for (kind, answer), count in sorted(total.items()):
        print(f"  {kind:30} {answer:24} {count}")
    for name in urls:
        list_ = sorted(waits[name]) or [float("nan")]
        refused = sum(count for (of, _), count in failed.items() if of == name)
        print(f"well-behaved client, {name}: {len(waits[name])} answers, {refused} failed {dict(failed) if refused else ''}, "
              f"median {statistics.median(list_):.2f} s, longest {list_[-1]:.2f} s")
    for name, (now, most) in peaks.items():
        print(f"memory, {name}: {now:.0f} MiB at the end, {most:.0f} MiB at most")
    print(f"alive at the end: {alive}, exit codes {codes}")
    sys.exit(0 if all(alive) and codes == [0, 0, 0] else 1)


def gaps(spf, flights, connections):
    """Intervals between stick commands, and the greatest memory of server and flight."""
    all_, most, tried = [], [0.0, 0.0], collections.Counter()
    for number in range(flights):
        stop, threads = threading.Event(), []

        def during(url, served, client):
            host, port = re.match(r"http://([0-9.]+):(\d+)", url).groups()
            targets = [(host, int(port)), ("127.0.0.1", 8766)]
            for n in range(connections):
                stranger = Stranger(targets[n % 2], n, stop)
                work = stranger.oversized if n % 10 == 0 else stranger.slow

                def again(work=work, stranger=stranger):
                    while not stop.is_set():
                        work()
                    tried.update(stranger.tried)

                threads.append(threading.Thread(target=again))
            if connections:
                ports = (setpoints.LOCAL, [8890, 11111])
                threads.append(threading.Thread(target=datagrams, args=(ports, number, stop, tried, "127.0.0.99")))

            def watch():
                while not stop.is_set():
                    for n, process in enumerate((served, client)):
                        try:
                            most[n] = max(most[n], memory(process.pid)[1])
                        except (OSError, TypeError):
                            pass
                    time.sleep(0.2)

            threads.append(threading.Thread(target=watch))
            for thread in threads:
                thread.start()

        with tempfile.TemporaryDirectory() as folder:
            live = ["--live=127.0.0.1:8766"]
            said, flying, stopped = setpoints.flight(spf, folder, 12.0, live, during)
        stop.set()
        for thread in threads:
            thread.join()
        if not flying or not stopped:
            sys.exit("the flight ended before it could be stopped")
        sticks = [at for at, text in said if text.startswith("rc ") and flying + 1.0 < at < stopped]
        all_ += [later - earlier for earlier, later in zip(sticks, sticks[1:])]
    all_.sort()
    return all_, most, tried


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("spf")
    parser.add_argument("--minutes", type=float, default=30)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--flying", type=int, help="connections while flying")
    parser.add_argument("--flights", type=int, default=3)
    given = parser.parse_args()
    given.spf = os.path.abspath(given.spf)
    if given.flying is None:
        besiege(given.spf, given.minutes, given.seed)
    for connections in (0, given.flying):
        all_, most, tried = gaps(given.spf, given.flights, connections)
        p99 = all_[int(0.99 * len(all_))]
        print(f"{given.flights} flights, {connections} connections: {len(all_)} intervals between stick commands, median "
              f"{1e3 * statistics.median(all_):.0f} ms, p99 {1e3 * p99:.0f} ms, longest {1e3 * all_[-1]:.0f} ms; memory of the "
              f"server {most[0]:.0f} MiB, of the flight {most[1]:.0f} MiB at most")
        for (kind, answer), count in sorted(tried.items()):
            print(f"  {kind:30} {answer:24} {count}")


if __name__ == "__main__":
    main()
