"""A vehicle by pymavlink that signs its packets, moves nowhere, and answers nothing, as an autopilot that wants signed packets."""

import os
import sys
import time

os.environ["MAVLINK20"] = "1"
from pymavlink import mavutil  # noqa: E402

link = mavutil.mavlink_connection(sys.argv[1], source_system=1, source_component=1)
link.setup_signing(bytes(range(32)), sign_outgoing=True)
begun = time.time()
while True:
    boot = int(1000 * (time.time() - begun)) + 5000
    link.mav.heartbeat_send(2, 12, 81, 0x03040000, 3)
    link.mav.extended_sys_state_send(0, 1)
    for _ in range(10):
        link.mav.attitude_send(boot, 0, 0, 0, 0, 0, 0)
        link.mav.local_position_ned_send(boot, 0, 0, 0, 0, 0, 0)
        boot += 50
        time.sleep(0.05)
