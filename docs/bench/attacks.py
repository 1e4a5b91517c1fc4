"""The attacks of hostile.py: what the man in the middle changes, by kind of datagram."""
import re


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
