#!/usr/bin/env python3
"""Shows a flight in Rerun: camera with waypoints, world with outlines, path and plan, and the log messages.

    pip install rerun-sdk mcap mcap-protobuf-support
    python3 docs/viewers/rerun_flight.py flights/001-fly-to-the-red-crane/flight.mcap
    python3 docs/viewers/rerun_flight.py flight.mcap --screenshot flight.png --at 20

Rerun reads images, transforms, camera and log lines from the file by itself. Outlines, plans, waypoints and the flown path, which it
does not read in Foxglove's format, are added here.
"""
import argparse
import pathlib
import time

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

TIMELINE = "message_log_time"
BLUEPRINT = rrb.Blueprint(
    rrb.Horizontal(
        rrb.Vertical(
            rrb.Spatial2DView(origin="/camera/image", contents=["/camera/image", "/camera/image/waypoint"], name="camera"),
            rrb.TextLogView(origin="/log", contents="/log", name="log"),
            row_shares=[3, 2],
        ),
        rrb.Spatial3DView(
            origin="/",
            contents=["/world/**", "/tf", "/camera/calibration"],
            name="world",
            spatial_information=rrb.SpatialInformation(target_frame="world", show_axes=False),
            eye_controls=rrb.EyeControls3D(position=[-60, -70, 70], look_target=[20, 30, 5], eye_up=[0, 0, 1]),
        ),
        column_shares=[2, 3],
    ),
    rrb.TimePanel(timeline=TIMELINE, state="collapsed"),
    collapse_panels=True,
)
TOPICS = ["/scene", "/plan", "/pose/known", "/pose/true", "/camera/annotations"]


def lines(entity):
    """Ends of an entity's lines, in pairs."""
    points = [(point.x, point.y, point.z) for line in entity.lines for point in line.points]
    return np.array(points).reshape(-1, 2, 3)


def colour(entity):
    drawn = entity.lines[0].color
    return [drawn.r, drawn.g, drawn.b]


def in_world(path, *archetypes, **options):
    rr.log(path, *archetypes, rr.CoordinateFrame("world"), **options)


def add_what_rerun_does_not_know(log):
    ways = {"/pose/known": [], "/pose/true": []}
    with open(log, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, message, value in reader.iter_decoded_messages(topics=TOPICS):
            rr.set_time(TIMELINE, timestamp=message.log_time * 1e-9)
            if channel.topic == "/scene":
                strips = np.concatenate([lines(entity) for entity in value.entities])
                colours = np.concatenate([[colour(entity)] * len(lines(entity)) for entity in value.entities])
                in_world("world/scene", rr.LineStrips3D(strips, colors=colours, radii=0.05), static=True)
            elif channel.topic == "/plan":
                in_world("world/plan", rr.LineStrips3D(lines(value.entities[0]), colors=[255, 60, 230], radii=0.15))
            elif channel.topic == "/camera/annotations":
                marks = [(circle.position.x, circle.position.y) for circle in value.circles]
                captions = [text.text for text in value.texts][: len(marks)]
                drawn = rr.Points2D(marks, labels=captions, colors=[255, 60, 230], radii=8)
                rr.log("camera/image/waypoint", drawn, rr.CoordinateFrame("camera_image_plane"))
            else:
                way = ways[channel.topic]
                way.append((value.pose.position.x, value.pose.position.y, value.pose.position.z))
                if len(way) % 10 == 0:
                    shade = [80, 160, 255] if channel.topic == "/pose/true" else [150, 150, 150]
                    in_world("world" + channel.topic, rr.LineStrips3D([way], colors=shade, radii=0.12))


def show(log):
    rr.log_file_from_path(log)
    add_what_rerun_does_not_know(log)
    rr.send_blueprint(BLUEPRINT)


def take_screenshot(log, picture, at):
    from rerun.experimental import ViewerClient

    with ViewerClient.spawn(headless=True, port=9913) as viewer:
        rr.connect_grpc(viewer.url, default_blueprint=BLUEPRINT)
        show(log)
        # The viewer does not report when it has rendered everything.
        time.sleep(8)
        viewer.set_time(TIMELINE, timestamp=at, play_state="paused")
        time.sleep(4)
        viewer.save_screenshot(str(pathlib.Path(picture).resolve()))
        rr.disconnect()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("log")
    parser.add_argument("--screenshot", metavar="PNG", help="write a picture of the viewer instead of opening it")
    parser.add_argument("--at", type=float, default=10.0, help="flight time of the picture, seconds")
    parser.add_argument("--save", metavar="RRD", help="write Rerun's own file instead of opening it")
    args = parser.parse_args()
    rr.init("spf")
    if args.screenshot:
        take_screenshot(args.log, args.screenshot, args.at)
    elif args.save:
        rr.save(args.save, default_blueprint=BLUEPRINT)
        show(args.log)
    else:
        rr.spawn(default_blueprint=BLUEPRINT)
        show(args.log)


if __name__ == "__main__":
    main()
