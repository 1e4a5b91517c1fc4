#!/usr/bin/env python3
"""Attacks flights of a Tello over real sockets, from between the program and the drone.

    python3 docs/bench/hostile.py target/release/spf [--minutes 30] [--attack NAME] [--tsv FILE]

A man in the middle relays commands, answers, state and video between `spf fly` and the virtual Tello, and changes them as each
attack says, from 1 s after the drone has first been told to move. Each attack is flown by the oracle and by hand (an events
file). SIGINT follows 8 s after the attack began, unless the flight has ended by then, and again 15 s later; the attack goes on.
The drone's own state lines, read before any change, say whether it is in the air. A flight fails if

- a motion is told to the drone more than 0.5 s after SIGINT, or after the attack's own bound (where the attack ends by itself:
  between that bound and its end);
- the program still runs 45 s after SIGINT, or ends more than 4 s before the drone is down, unless `land` cannot reach it;
- the drone is still in the air 30 s after the program has ended, or flies faster than 0.2 m/s more than 2.5 s after SIGINT,
  unless commands cannot reach it.
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

from attacks import ATTACKS, FAULTS, fields

ATTACK_AFTER, SIGINT_AFTER, SECOND_SIGINT, NOTICED, ENDS_WITHIN, LANDS_WITHIN = 1.0, 8.0, 15.0, 0.5, 45.0, 30.0
# A drone that is landing may still be in the air for this long after the program ended, s.
LANDING = 4.0
# Speed that counts as flying on, dm/s, and until when a drone that gets its commands has come to rest.
FLIES_ON, RESTS_WITHIN = 2.0, 2.5
EVENTS = """[[event]]\nat_s = 9.0\ndo = "setpoint"\n{axis} = {speed}\nfor_s = 30.0\n"""


def moves(text):
    return text.startswith(("rc ", "go ", "up ", "forward ")) and text != "rc 0 0 0 0"


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
        self.truth, self.told, self.tried, self.speeds = (None, {}), [], [], []
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
            speed = [int(self.truth[1].get(key, 0)) for key in ("vgx", "vgy")]
            self.speeds.append((now, (speed[0] ** 2 + speed[1] ** 2) ** 0.5))
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
    air = middle.in_the_air()
    while air and time.monotonic() - ended < LANDS_WITHIN:
        time.sleep(0.2)
        air = middle.in_the_air()
    air_for = time.monotonic() - ended if middle.began else 0.0
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
    on = [at for at, speed in middle.speeds if speed > FLIES_ON]
    flies_on = max(0.0, on[-1] - stopped) if on and stopped else 0.0
    if flies_on > RESTS_WITHIN and attack.lands and not FAULTS.get(name):
        problems.append(f"the drone flies on for {flies_on:.1f} s after SIGINT")
    if air_for > LANDING and attack.lands and not FAULTS.get(name):
        problems.append(f"the drone was in the air for {air_for:.1f} s after the program ended")
    if air and not FAULTS.get(name):
        problems.append("the drone stays in the air")
    if not any(text == "land" for _, text in middle.tried):
        problems.append("no `land` was sent")
    reason = next((line.strip() for line in reversed(printed) if re.search(r"abort|fail|land|reach|timeout|found", line)), "")
    reason = re.sub(r"\x1b\[[0-9;]*m", "", reason)
    row = dict(attack=name, by="hand" if by_hand else "pilot", attacked=attacked, last_motion=after_attack, after_sigint=after_stop, flies_on=flies_on,
               sigint=stopped is not None, exit=exit_code, highest=highest, air_for=air_for, air_later=bool(air),
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
                      f" flies {row['flies_on']:.1f} s after it,"
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
