#!/usr/bin/env python3
"""Records the video of a virtual Tello, and decodes it with PyAV as djitellopy does, for comparison with our driver on the same file.

    pip install av pillow numpy
    spf sim serve --tello --listen 127.0.0.61 --scene office --quality live &
    python3 docs/bench/tello_video.py record 127.0.0.61 127.0.0.62 video.h264 20
    python3 docs/bench/tello_video.py decode video.h264
    TELLO_VIDEO=$PWD/video.h264 cargo bench -p spf-drone
"""

import socket
import sys
import time


def record(drone, local, path, seconds):
    """Turns and climbs by `rc`, so that the images change, and writes the data received on the video port."""
    command, video = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
    video.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
    command.bind((local, 0))
    video.bind((local, 11111))
    command.settimeout(20)
    video.settimeout(3)

    def say(text):
        command.sendto(text.encode(), (drone, 8889))
        return command.recv(1500)

    print(say("command"), say("takeoff"), say("streamon"))
    command.sendto(b"rc 0 0 10 40", (drone, 8889))
    end, written, unit = time.time() + seconds, 0, b""
    with open(path, "wb") as file:
        while time.time() < end:
            datagram = video.recv(2048)
            unit += datagram
            # A shorter one ends its NAL unit; only complete ones are kept.
            if len(datagram) < 1460:
                written += file.write(unit)
                unit = b""
    command.sendto(b"rc 0 0 0 0", (drone, 8889))
    print(f"{written} bytes", say("streamoff"), say("land"))


def decode(path, rounds=3):
    """djitellopy's reader: every frame is converted through a PIL image to an RGB array, here on one thread."""
    import av
    import numpy as np

    times = []
    for _ in range(rounds):
        container = av.open(path, format="h264")
        container.streams.video[0].thread_count = 1
        for packet in container.demux(video=0):
            begun = time.perf_counter()
            try:
                pictures = [np.array(frame.to_image()) for frame in packet.decode()]
            except av.error.InvalidDataError:
                # Parameter sets at the very end, whose image was not recorded.
                continue
            if pictures:
                times.append(time.perf_counter() - begun)
    times.sort()
    print(
        f"{len(times)} pictures, {len(times) / sum(times):.0f} a second; "
        f"median {1e3 * times[len(times) // 2]:.1f} ms, 99 of 100 within {1e3 * times[int(0.99 * (len(times) - 1))]:.1f} ms"
    )


if __name__ == "__main__":
    if len(sys.argv) > 5 and sys.argv[1] == "record":
        record(*sys.argv[2:5], float(sys.argv[5]))
    elif len(sys.argv) == 3 and sys.argv[1] == "decode":
        decode(sys.argv[2])
    else:
        sys.exit(__doc__)
