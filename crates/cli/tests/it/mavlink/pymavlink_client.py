"""Flies a served PX4 or ArduPilot with pymavlink, unmodified, by the messages that its documents show. Prints what it saw."""

import json
import math
import os
import sys
import time

os.environ["MAVLINK20"] = "1"
from pymavlink import mavutil  # noqa: E402

PX4 = sys.argv[2] == "px4"
SHORT = "--short" in sys.argv
NAN = float("nan")
link = mavutil.mavlink_connection(sys.argv[1], source_system=255, source_component=190)
seen = {"texts": []}


def receive(kind, wanted=lambda message: True, timeout=20):
    end = time.time() + timeout
    while time.time() < end:
        message = link.recv_match(blocking=True, timeout=1)
        if message is None:
            continue
        if message.get_type() == "STATUSTEXT":
            seen["texts"].append(message.text)
        if message.get_type() == kind and wanted(message):
            return message
    raise SystemExit(f"no {kind} within {timeout} s; {seen}")


def command(number, *parameters):
    parameters = list(parameters) + [0] * (7 - len(parameters))
    for confirmation in range(4):
        link.mav.command_long_send(1, 1, number, confirmation, *parameters)
        try:
            return receive("COMMAND_ACK", lambda it: it.command == number, 1).result
        except SystemExit:
            continue
    raise SystemExit(f"no acknowledgement of {number}")


link.wait_heartbeat(timeout=10)
link.mav.heartbeat_send(6, 8, 0, 0, 0)
# Parameters, with both encodings of integers; a command that nobody knows.
link.mav.param_request_list_send(1, 1)
names = {}
while len(names) < (first := receive("PARAM_VALUE")).param_count - 1 or first.param_id not in names:
    names[first.param_id] = first.param_value
    if len(names) >= first.param_count:
        break
seen["parameters"] = len(names)
name = b"COM_OF_LOSS_T" if PX4 else b"GUID_TIMEOUT"
link.mav.param_set_send(1, 1, name, 2.0, 9)
seen["set"] = receive("PARAM_VALUE", lambda it: it.param_id == name.decode()).param_value
seen["unknown"] = command(54321)
# An old client speaks version 1.
seen["version"] = command(512, 148)
receive("AUTOPILOT_VERSION")
# A mission is refused politely, and a list is empty.
link.mav.mission_request_list_send(1, 1, 0)
seen["missions"] = receive("MISSION_COUNT").count
link.mav.mission_count_send(1, 1, 3, 0)
seen["upload"] = receive("MISSION_ACK").type
receive("SYS_STATUS", lambda it: it.onboard_control_sensors_health & 0x10000000)
seen["offboard_too_early"] = command(176, 1, 6, 0) if PX4 else command(22, 0, 0, 0, 0, 0, 0, 3)
if not PX4:
    seen["guided"] = command(176, 1, 4)
seen["arm"] = command(400, 1)
receive("HEARTBEAT", lambda it: it.base_mode & 128)
seen["takeoff"] = command(22, 0, 0, 0, NAN, NAN, NAN, NAN if PX4 else 3)
receive("EXTENDED_SYS_STATE", lambda it: it.landed_state == 2, 30)
if not SHORT:
    for number in range(60):
        link.mav.set_position_target_local_ned_send(0, 1, 1, 8, 0x05C7, 0, 0, 0, 1.5, 0, 0, 0, 0, 0, 0, 0.0)
        time.sleep(0.05)
        if PX4 and number == 25:
            seen["offboard"] = command(176, 1, 6, 0)
    for _ in range(60):
        link.mav.set_position_target_local_ned_send(0, 1, 1, 8, 0x05C7, 0, 0, 0, 1.5, 0, 0, 0, 0, 0, 0, 0.0)
        time.sleep(0.05)
    while link.recv_msg():
        pass
    speed = receive("LOCAL_POSITION_NED")
    seen["speed_m_s"] = math.hypot(speed.vx, speed.vy)
    # Silence: PX4 leaves the mode, ArduPilot stops in it.
    time.sleep(5)
    while link.recv_msg():
        pass
    speed = receive("LOCAL_POSITION_NED")
    seen["silent_m_s"] = math.hypot(speed.vx, speed.vy)
    seen["silent_mode"] = receive("HEARTBEAT", lambda it: it.type == 2).custom_mode
    if PX4:
        # A frame that PX4 does not take.
        link.mav.set_position_target_local_ned_send(0, 1, 1, 9, 0x05C7, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0)
        seen["frame_9"] = receive("STATUSTEXT", lambda it: "invalid" in it.text, 5).text
seen["land"] = command(21, 0, 0, 0, NAN)
receive("HEARTBEAT", lambda it: it.type == 2 and not it.base_mode & 128, 40)
print(json.dumps(seen))
