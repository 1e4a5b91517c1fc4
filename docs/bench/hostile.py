#!/usr/bin/env python3
"""Attacks flights of a Tello over real sockets, from between the program and the drone.

    python3 docs/bench/hostile.py target/release/spf [--minutes 30] [--attack NAME] [--tsv FILE]

A man in the middle relays commands, answers, state and video between `spf fly` and the virtual Tello, and changes them as each
attack says, from 1 s after the drone has first been told to move. Each attack is flown by the oracle and by hand (an events
file). SIGINT follows 8 s after the attack began, unless the flight has ended by then, and again 15 s later; the attack goes on.
The drone's own state lines, read before any change, say whether it is in the air. A flight fails if

- a motion is told to the drone more than 0.5 s after SIGINT, or after the attack's own bound (where the attack ends by itself:
  between that bound and its end);
- the program still runs 45 s after SIGINT, or ends while the drone is in the air, unless `land` cannot reach it;
- the drone is still in the air 30 s after the program has ended.
"""
import argparse
import os
import random
import re
import select
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time

ATTACK_AFTER, SIGINT_AFTER, SECOND_SIGINT, NOTICED, ENDS_WITHIN, LANDS_WITHIN = 1.0, 8.0, 15.0, 0.5, 45.0, 30.0
EVENTS = """[[event]]\nat_s = 9.0\ndo = "setpoint"\n{axis} = {speed}\nfor_s = 30.0\n"""


def moves(text):
    return text.startswith(("rc ", "go ", "up ", "forward ")) and text != "rc 0 0 0 0"


def fields(line):
    return dict(part.split(":", 1) for part in line.decode(errors="replace").strip().strip(";").split(";") if ":" in part)


def changed(line, **new):
    """A state line with some values replaced; `None` leaves the value out."""
    text = line.decode()
    for key, value in new.items():
        text = re.sub(rf"(^|;){key}:[^;]*;", lambda m: m[1] + (f"{key}:{value};" if value is not None else ""), text)
    return text.encode()


class Attack:
    """Passes everything. `kind` is command, answer, state or video; returns (delay, bytes) of what goes on."""

    # Whether `land` reaches the drone while the attack lasts; the time after its start from which no motion may be told.
    lands, bound, until = True, None, None

    def __init__(self, rng):
        self.rng, self.memory = rng, {}

    def change(self, kind, data, age):
        return [(0.0, data)]

    def extra(self, age):
        """Datagrams to the client: (kind, bytes), each 50 ms."""
        return []


def attack(lands=True, bound=None, until=None):
    def make(change):
        name = change.__name__
        ATTACKS[name] = type(name, (Attack,), {"change": change, "lands": lands, "bound": bound, "until": until, "__doc__": change.__doc__})
        return change
    return make


ATTACKS = {"none": Attack}
PASS = lambda data: [(0.0, data)]


@attack()
def answers_say_motor_stop(self, kind, data, age):
    return PASS(b"error Motor stop" if kind == "answer" else data)


@attack()
def answers_say_error(self, kind, data, age):
    return PASS(b"error" if kind == "answer" else data)


@attack(bound=4.0)
def answers_lost(self, kind, data, age):
    return [] if kind == "answer" else PASS(data)


@attack()
def answers_are_bytes(self, kind, data, age):
    return PASS(self.rng.randbytes(self.rng.randrange(0, 1400)) if kind == "answer" else data)


@attack(lands=False)
def land_lost_and_answered(self, kind, data, age):
    return [] if kind == "command" and data == b"land" else PASS(b"error Motor stop" if kind == "answer" else data)


@attack(lands=False)
def land_and_zeros_lost(self, kind, data, age):
    """The drone keeps its velocity, and the questions for its battery keep it in the air."""
    return [] if kind == "command" and data in (b"land", b"stop", b"rc 0 0 0 0") else PASS(data)


@attack(lands=False)
def land_lost_and_ground_shown(self, kind, data, age):
    if kind == "command" and data == b"land":
        self.memory["land"] = age
        return []
    if kind == "state" and "land" in self.memory:
        data = changed(data, h=0, tof=10, time=20, vgx=0, vgy=0, vgz=0)
    return PASS(data)


@attack(lands=False, bound=4.6)
def commands_lost(self, kind, data, age):
    return [] if kind == "command" else PASS(data)


@attack(lands=False)
def commands_lost_and_answered(self, kind, data, age):
    return [] if kind == "command" else PASS(data)


def forged(self, age):
    return [("answer", b"80\r\n")] if int(age * 20) % 10 == 0 else []


ATTACKS["commands_lost_and_answered"].extra = forged


@attack(lands=False, bound=2.0)
def everything_lost(self, kind, data, age):
    return []


@attack(bound=1.6, until=3.0)
def everything_lost_for_3_s(self, kind, data, age):
    return [] if age < 3.0 else PASS(data)


@attack(bound=1.6, until=3.0)
def everything_held_back_for_3_s(self, kind, data, age):
    return [(max(0.0, 3.0 - age), data)] if kind != "command" else PASS(data)


@attack()
def everything_five_times(self, kind, data, age):
    return [(0.03 * n, data) for n in range(5)] if kind != "video" else PASS(data)


@attack()
def everything_reordered(self, kind, data, age):
    return [(self.rng.random() * 0.6, data)] if kind != "video" else PASS(data)


@attack()
def a_third_lost(self, kind, data, age):
    return [] if self.rng.random() < 0.3 else PASS(data)


@attack()
def state_on_the_ground(self, kind, data, age):
    return PASS(changed(data, h=0, tof=10, time=5) if kind == "state" else data)


@attack()
def state_motors_stopped_in_the_air(self, kind, data, age):
    return PASS(changed(data, time=5) if kind == "state" else data)


@attack()
def state_never_on_the_ground(self, kind, data, age):
    return PASS(changed(data, h=80, tof=90, time=int(20 + age)) if kind == "state" else data)


@attack()
def state_height_stuck(self, kind, data, age):
    if kind == "state":
        seen = self.memory.setdefault("first", fields(data))
        data = changed(data, **{key: seen[key] for key in ("h", "tof", "baro", "vgz")})
    return PASS(data)


@attack()
def state_speed_zero(self, kind, data, age):
    return PASS(changed(data, vgx=0, vgy=0) if kind == "state" else data)


@attack()
def state_speed_20_m_s(self, kind, data, age):
    return PASS(changed(data, vgx=200, vgy=-200, vgz=200) if kind == "state" else data)


@attack(bound=1.6)
def state_without_numbers(self, kind, data, age):
    return PASS(re.sub(rb":[^;]*;", b":nan;", data) if kind == "state" else data)


@attack(bound=1.6)
def state_without_yaw(self, kind, data, age):
    return PASS(changed(data, yaw=None) if kind == "state" else data)


@attack()
def state_yaw_random(self, kind, data, age):
    return PASS(changed(data, yaw=self.rng.randrange(-180, 180)) if kind == "state" else data)


@attack(bound=2.4)
def state_repeated(self, kind, data, age):
    return PASS(self.memory.setdefault("line", data) if kind == "state" else data)


@attack()
def state_fields_twice(self, kind, data, age):
    return PASS(data.replace(b"\r\n", b"") * 5 if kind == "state" else data)


@attack()
def state_late(self, kind, data, age):
    return [(1.5, data)] if kind == "state" else PASS(data)


@attack(bound=5.6)
def battery_zero(self, kind, data, age):
    if kind == "answer" and data.strip().isdigit():
        data = b"0\r\n"
    return PASS(changed(data, bat=0) if kind == "state" else data)


@attack()
def state_flood(self, kind, data, age):
    return PASS(data)


def flood(self, age):
    line = "pitch:%d;roll:%d;yaw:%d;vgx:%d;vgy:%d;vgz:%d;templ:60;temph:62;tof:%d;h:%d;bat:%d;baro:1.00;time:%d;agx:%d;agy:0;agz:-1000;\r\n"
    draw = lambda low, high: self.rng.randrange(low, high)
    return [("state", (line % (draw(-90, 90), draw(-90, 90), draw(-180, 180), draw(-20, 20), draw(-20, 20), draw(-9, 9),
                               draw(0, 900), draw(0, 900), draw(0, 100), draw(0, 99), draw(0, 999))).encode()) for _ in range(25)]


ATTACKS["state_flood"].extra = flood


@attack()
def answers_flood(self, kind, data, age):
    return PASS(data)


ATTACKS["answers_flood"].extra = lambda self, age: [
    ("answer", self.rng.choice([b"ok", b"error", b"80", b"forced stop", b"error Motor stop", b"error No valid imu", b"\xcc\x01", b""]))
    for _ in range(25)]


@attack()
def answers_say_imu(self, kind, data, age):
    return PASS(b"error No valid imu" if kind == "answer" else data)


@attack()
def strangers(self, kind, data, age):
    """The same floods from another address: nothing of it counts."""
    return PASS(data)


ATTACKS["strangers"].extra = lambda self, age: [("stranger " + kind, data) for kind, data in flood(self, age)[:10]] + [
    ("stranger answer", b"error Motor stop"), ("stranger video", self.rng.randbytes(1460))]


@attack(bound=1.8)
def video_lost(self, kind, data, age):
    return [] if kind == "video" else PASS(data)


@attack(bound=1.8)
def video_random(self, kind, data, age):
    return PASS(self.rng.randbytes(len(data)) if kind == "video" else data)


@attack(bound=1.8)
def video_without_key_frames(self, kind, data, age):
    """After a loss no key frame begins, so that nothing can be decoded correctly."""
    if kind == "video" and (age < 0.3 or (data[:4] == b"\x00\x00\x00\x01" and data[4] & 0x1F == 5)):
        return []
    return PASS(data)


@attack()
def video_replay(self, kind, data, age):
    """Two seconds of video again and again, with a key frame at the start. Not detected: the images differ."""
    if kind != "video":
        return PASS(data)
    stored = self.memory.setdefault("stored", [])
    if age < 2.2:
        if stored or b"\x00\x00\x01\x67" in data:
            stored.append(data)
        return PASS(data)
    if not stored:
        return []
    self.memory["next"] = (self.memory.get("next", -1) + 1) % len(stored)
    return PASS(stored[self.memory["next"]])


@attack()
def datagrams_of_any_size(self, kind, data, age):
    if kind in ("state", "answer") and self.rng.random() < 0.5:
        return [(0.0, self.rng.randbytes(self.rng.choice([0, 1, 1024, 1025, 1461, 9000]))), (0.0, data)]
    return PASS(data)


@attack(lands=False, bound=2.6)
def reboots(self, kind, data, age):
    """The drone restarts in the air, by the server's own fault: its motors stop."""
    return PASS(data)


@attack(lands=False, bound=2.6)
def reboots_twice(self, kind, data, age):
    return PASS(data)


FAULTS = {"reboots": [(0.0, 0.2)], "reboots_twice": [(0.0, 0.2), (9.0, 9.2)]}


class Middle:
    """The man in the middle: threads for both directions, and the record of what the drone heard and said."""

    def __init__(self, attack, addresses):
        self.drone, self.address, self.local, self.stranger = addresses
        bind = lambda address, port: self.socket(address, port)
        self.near, self.far = bind(self.address, 8889), bind(self.address, 0)
        self.state, self.video = bind(self.address, 8890), bind(self.address, 11111)
        self.strange = bind(self.stranger, 0)
        self.attack = attack
        self.client, self.began, self.ended, self.first = None, None, False, None
        # The drone's own state, and what it was told, with times.
        self.truth, self.told, self.tried = (None, {}), [], []
        self.later, self.lock = [], threading.Lock()
        self.on_attack = None
        self.threads = [threading.Thread(target=run, daemon=True) for run in (self.relay, self.delay)]
        for thread in self.threads:
            thread.start()

    @staticmethod
    def socket(address, port):
        made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
        made.bind((address, port))
        made.setblocking(False)
        return made

    def age(self):
        return None if self.began is None else time.monotonic() - self.began

    def send(self, kind, data):
        try:
            if kind == "command":
                now, text = time.monotonic(), data.decode(errors="replace")
                self.told.append((now, text))
                self.far.sendto(data, (self.drone, 8889))
            elif kind == "answer" and self.client:
                self.near.sendto(data, self.client)
            elif kind == "state":
                self.state.sendto(data, (self.local, 8890))
            elif kind == "video":
                self.video.sendto(data, (self.local, 11111))
            elif kind.startswith("stranger") and self.client:
                to = {"answer": self.client, "state": (self.local, 8890), "video": (self.local, 11111)}[kind.split()[1]]
                self.strange.sendto(data, to)
        except OSError:
            pass

    def pass_on(self, kind, data):
        now = time.monotonic()
        if kind == "command":
            text = data.decode(errors="replace")
            self.tried.append((now, text))
            if self.first is None and moves(text):
                self.first = now
            if self.first is not None and self.began is None and now >= self.first + ATTACK_AFTER and moves(text):
                self.began = now
                if self.on_attack:
                    self.on_attack()
        elif kind == "state":
            self.truth = (now, fields(data))
        age = self.age()
        if age is None:
            return self.send(kind, data)
        for delay, bytes_ in self.attack.change(kind, data, age):
            if delay <= 0.0:
                self.send(kind, bytes_)
            else:
                with self.lock:
                    self.later.append((now + delay, kind, bytes_))

    def relay(self):
        kinds = {self.near: "command", self.far: "answer", self.state: "state", self.video: "video"}
        while not self.ended:
            for ready in select.select(list(kinds), [], [], 0.1)[0]:
                while True:
                    try:
                        data, sender = ready.recvfrom(4096)
                    except OSError:
                        break
                    if ready is self.near:
                        self.client = sender
                    self.pass_on(kinds[ready], data)

    def delay(self):
        last = 0.0
        while not self.ended:
            time.sleep(0.005)
            now = time.monotonic()
            with self.lock:
                due = sorted(item for item in self.later if item[0] <= now)
                self.later = [item for item in self.later if item[0] > now]
            for _, kind, data in due:
                self.send(kind, data)
            if self.began is not None and now - last >= 0.05:
                last = now
                for kind, data in self.attack.extra(now - self.began):
                    self.send(kind, data)

    def in_the_air(self):
        """By the drone's own state lines: its motors turn, or it is above the ground."""
        at, state = self.truth
        if at is None or time.monotonic() - at > 3.0:
            return None
        return int(state.get("h", 0)) >= 20 or int(state.get("tof", 10)) > 30 and int(state.get("tof", 10)) < 6553

    def close(self):
        self.ended = True
        for thread in self.threads:
            thread.join(timeout=2.0)
        for one in (self.near, self.far, self.state, self.video, self.strange):
            one.close()


def fly(spf, name, by_hand, rng, folder, addresses):
    attack = ATTACKS[name](rng)
    drone, address, local, _ = addresses
    faults = os.path.join(folder, "faults.toml")
    open(faults, "w").close()
    serve = [spf, "sim", "serve", "--tello", "--listen", drone, "--vlm", "--scene", "office", "--quality", "draft", "--fault", faults]
    served = subprocess.Popen(serve, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    born, url, out = None, None, []
    for line in served.stdout:
        out.append(line)
        found = re.search(r"http://[0-9.]+:\d+", line)
        if found:
            # The server's clock has started.
            url, born = found[0], time.monotonic()
            break
    threading.Thread(target=lambda: out.extend(served.stdout), daemon=True).start()
    middle = Middle(attack, addresses)

    def write_faults():
        now = time.monotonic() - born
        rules = [f'[[craft]]\nfault = "reboot"\nfrom = {now + a + 0.4}\nuntil = {now + b + 0.4}\n' for a, b in FAULTS.get(name, [])]
        with open(faults, "w") as file:
            file.write("\n".join(rules))

    middle.on_attack = write_faults if name in FAULTS else None
    env = {**os.environ, "OPENAI_API_KEY": "none", "SPF_TELLO_LOCAL": local}
    command = [spf, "fly", "fly to the vending machine", "--drone", f"tello@{address}", "--vlm", f"openai@{url}/v1", "--no-vlm-check",
               "--unattended", "--no-video", "--out", os.path.join(folder, "flight")]
    if by_hand:
        events = os.path.join(folder, "events.toml")
        with open(events, "w") as file:
            axis = "up_m_s" if name == "state_height_stuck" else rng.choice(["forward_m_s", "right_m_s"])
            file.write(EVENTS.format(axis=axis, speed=0.4 if axis == "up_m_s" else rng.choice([0.3, -0.3, 0.5])))
        command += ["--events", events]
    client = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=env)
    printed = []
    reader = threading.Thread(target=lambda: printed.extend(client.stderr), daemon=True)
    reader.start()
    start, stopped, again, highest = time.monotonic(), None, False, 0
    while client.poll() is None:
        time.sleep(0.02)
        now = time.monotonic()
        highest = max(highest, int(middle.truth[1].get("h", 0)))
        age = middle.age()
        late = (age is not None and age >= SIGINT_AFTER) or (age is None and now - start > 60.0)
        if stopped is None and late:
            stopped = now
            client.send_signal(signal.SIGINT)
        if stopped is not None and not again and now - stopped > SECOND_SIGINT:
            again = True
            client.send_signal(signal.SIGINT)
        if stopped is not None and now - stopped > ENDS_WITHIN:
            client.kill()
            break
    exit_code, ended = client.wait(), time.monotonic()
    attacked = 0.0 if middle.began is None else ended - middle.began
    # After the program has ended, nobody commands the drone; the attack has ended as well.
    air_at_end, air = middle.in_the_air(), middle.in_the_air()
    while air and time.monotonic() - ended < LANDS_WITHIN:
        time.sleep(0.2)
        air = middle.in_the_air()
    served.send_signal(signal.SIGINT)
    served.wait()
    middle.close()
    reader.join(timeout=2.0)
    problems = []
    if middle.began is None:
        problems.append("never moved")
    said = [at for at, text in middle.tried if moves(text)]
    last = said[-1] if said else None
    after_attack = last - middle.began if last and middle.began else None
    after_stop = last - stopped if last and stopped and last > stopped else 0.0
    if after_stop > NOTICED:
        problems.append(f"motion {after_stop:.2f} s after SIGINT")
    # By hand the operator needs no camera.
    if attack.bound is not None and middle.began and not (by_hand and name.startswith("video")):
        until = float("inf") if attack.until is None else attack.until
        late = [at - middle.began for at in said if attack.bound < at - middle.began < until]
        if late:
            problems.append(f"motion {late[-1]:.1f} s after the attack began, bound {attack.bound} s")
    if stopped is not None and ended - stopped > ENDS_WITHIN:
        problems.append("the program does not end")
    if air_at_end and attack.lands and not FAULTS.get(name):
        problems.append("the program ended with the drone in the air")
    if air and not FAULTS.get(name):
        problems.append("the drone stays in the air")
    if not any(text == "land" for _, text in middle.tried):
        problems.append("no `land` was sent")
    reason = next((line.strip() for line in reversed(printed) if re.search(r"abort|fail|land|reach|timeout|found", line)), "")
    reason = re.sub(r"\x1b\[[0-9;]*m", "", reason)
    row = dict(attack=name, by="hand" if by_hand else "pilot", attacked=attacked, last_motion=after_attack, after_sigint=after_stop,
               sigint=stopped is not None, exit=exit_code, highest=highest, air_at_end=bool(air_at_end), air_later=bool(air),
               problems="; ".join(problems), reason=reason)
    if problems:
        log = os.path.join(tempfile.gettempdir(), f"hostile-{name}-{row['by']}.log")
        with open(log, "w") as file:
            file.writelines(printed + ["\n-- server --\n"] + out)
            file.writelines(f"{at - (middle.began or start):8.3f} {text}\n" for at, text in middle.tried)
    return row


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("spf")
    parser.add_argument("--minutes", type=float, default=30.0, help="least time under attack, all flights together")
    parser.add_argument("--attack", action="append", choices=sorted(ATTACKS), help="only this one; can be repeated")
    parser.add_argument("--by", choices=["pilot", "hand"], help="only these flights")
    parser.add_argument("--slot", type=int, default=0, help="uses other addresses, so that several can run at once (0 to 60)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--tsv", help="append a row for each flight to this file")
    given = parser.parse_args()
    rng, rows, attacked = random.Random(given.seed), [], 0.0
    names = given.attack or list(ATTACKS)
    # Of the drone, of the man in the middle, of the program, and of a stranger.
    addresses = [f"127.0.4.{4 * given.slot + n + 1}" for n in range(4)]
    while attacked < 60.0 * given.minutes or not rows:
        for name in names:
            for by_hand in (False, True):
                if given.by and by_hand != (given.by == "hand"):
                    continue
                with tempfile.TemporaryDirectory() as folder:
                    row = fly(given.spf, name, by_hand, rng, folder, addresses)
                attacked += row["attacked"]
                rows.append(row)
                motion = "-" if row["last_motion"] is None else f"{row['last_motion']:.1f}"
                print(f"{attacked / 60:5.1f} min  {name}, {row['by']}: last motion {motion} s, {row['after_sigint']:.2f} s after SIGINT,"
                      f" exit {row['exit']}, {row['highest']} cm; {row['problems'] or 'ok'} [{row['reason']}]", flush=True)
                if given.tsv:
                    with open(given.tsv, "a") as file:
                        file.write("\t".join(str(value) for value in row.values()) + "\n")
    moved = [row for row in rows if row["last_motion"] is not None]
    bad = [row for row in rows if row["problems"]]
    print(f"{len(rows)} flights, {len(moved)} with motion, {attacked / 60:.1f} min under attack, {len(bad)} with problems")
    sys.exit(1 if bad else 0)


if __name__ == "__main__":
    main()
