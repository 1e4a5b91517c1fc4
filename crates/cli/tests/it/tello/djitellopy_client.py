"""djitellopy, unmodified, flies the virtual Tello: every movement, rc, getters, video. Prints a JSON object of what was seen."""

import json
import sys
import time

import numpy as np
from PIL import Image
from djitellopy import Tello

Tello.LOGGER.setLevel("WARNING")
folder = sys.argv[1]
told = {"moves": {}}
tello = Tello()  # 192.168.10.1
began = time.time()
tello.connect()
told["connect_s"] = time.time() - began

assert 0 <= tello.get_battery() <= 100
assert abs(tello.query_battery() - tello.get_battery()) <= 1
assert tello.query_sdk_version() == "20", tello.query_sdk_version()
assert len(tello.query_serial_number()) == 14
assert int(tello.query_wifi_signal_noise_ratio()) == 90
assert tello.get_height() == 0 and 9 <= tello.get_distance_tof() <= 11, (tello.get_height(), tello.get_distance_tof())
assert tello.get_lowest_temperature() < tello.get_highest_temperature()
assert abs(tello.get_acceleration_z() + 1000) < 5 and tello.get_barometer() > 1000
assert all(abs(degrees) <= 4 for degrees in tello.query_attitude().values()), tello.query_attitude()
tello.get_speed_x(), tello.get_speed_y(), tello.get_speed_z(), tello.get_flight_time(), tello.get_mission_pad_id()

tello.streamon()
frames = tello.get_frame_read()
time.sleep(2)


def look(name):
    frame = frames.frame
    assert frame.shape == (720, 960, 3) and frame.std() > 10, (frame.shape, frame.std())
    Image.fromarray(frame).save(f"{folder}/{name}.png")
    return frame


def rate(seconds):
    """Distinct frames a second."""
    seen, last, end = 0, None, time.time() + seconds
    while time.time() < end:
        frame = frames.frame
        if frame is not last:
            seen, last = seen + 1, frame
        time.sleep(0.002)
    return seen / seconds


look("ground")
told["frames_per_s"] = rate(3)
began = time.time()
tello.takeoff()
told["takeoff_s"] = time.time() - began
time.sleep(0.5)
assert 50 <= tello.get_height() <= 110, tello.get_height()
before_turn = look("up").astype(int)


def timed(name, act):
    began = time.time()
    act()
    told["moves"][name] = time.time() - began
    time.sleep(0.15)


# Each move returns, because an office has walls.
timed("up 20", lambda: tello.move_up(20))
timed("down 20", lambda: tello.move_down(20))
timed("forward 20", lambda: tello.move_forward(20))
timed("back 20", lambda: tello.move_back(20))
timed("left 20", lambda: tello.move_left(20))
timed("right 20", lambda: tello.move_right(20))
yaw = tello.get_yaw()
timed("cw 90", lambda: tello.rotate_clockwise(90))
time.sleep(0.3)
turned = (tello.get_yaw() - yaw + 180) % 360 - 180
assert abs(turned - 90) < 10, turned
# Its reader gives up if the machine is too slow for about ten frames per second.
told["video_alive"] = frames.worker.is_alive()
if told["video_alive"]:
    assert np.abs(look("turned").astype(int) - before_turn).mean() > 5, "the picture turned too"
timed("ccw 90", lambda: tello.rotate_counter_clockwise(90))
timed("go", lambda: tello.go_xyz_speed(30, 0, 0, 50))
timed("go back", lambda: tello.go_xyz_speed(-30, 0, 0, 50))
timed("curve", lambda: tello.curve_xyz_speed(50, 50, 0, 0, 100, 0, 30))
timed("curve back", lambda: tello.curve_xyz_speed(50, -50, 0, 0, -100, 0, 30))
timed("flip", lambda: tello.flip_right())
timed("left 30", lambda: tello.move_left(30))
tello.set_speed(60)
# `query_speed` makes an int of it, which the point of a real drone's answer forbids.
assert tello.send_read_command("speed?").strip() == "60.0"
tello.enable_mission_pads()
tello.set_mission_pad_detection_direction(2)
tello.disable_mission_pads()

for _ in range(10):
    tello.send_rc_control(0, 0, 0, 60)
    time.sleep(0.1)
tello.send_rc_control(0, 0, 0, 0)
time.sleep(1)
assert tello.get_flight_time() > 10
began = time.time()
tello.land()
told["land_s"] = time.time() - began
time.sleep(0.3)
assert tello.get_height() == 0
tello.streamoff()
tello.end()
print(json.dumps(told))
