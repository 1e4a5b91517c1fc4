#!/usr/bin/env python3
"""Writes docs/viewers/foxglove-layout.json: a Foxglove layout for flight logs and live views.

    pip install foxglove-sdk
    python3 docs/viewers/foxglove_layout.py > docs/viewers/foxglove-layout.json
"""
import foxglove.layouts as fl


def panel(fraction, content):
    return fl.SplitItem(proportion=fraction, content=content)


def setpoints(axis):
    series = [("wanted", "dashed"), ("cleared", "solid")]
    return [
        fl.PlotSeries(value=f"/command.{name}.{axis}", label=f"{axis} {name}", line_style=style, line_interpolation="step")
        for name, style in series
    ]


CAMERA = fl.ImagePanel(
    config=fl.ImageConfig(
        image_mode=fl.ImageModeConfig(
            image_topic="/camera/image",
            calibration_topic="/camera/calibration",
            annotations={"/camera/annotations": fl.ImageAnnotationSettings(visible=True)},
            synchronize=True,
        )
    )
)
WORLD = fl.ThreeDeePanel(
    config=fl.ThreeDeeConfig(
        follow_tf="body",
        topics={
            "/scene": fl.BaseRendererSceneUpdateTopicSettings(visible=True),
            "/plan": fl.BaseRendererSceneUpdateTopicSettings(visible=True),
            "/path": fl.BaseRendererSceneUpdateTopicSettings(visible=True),
            "/map": fl.BaseRendererPointCloudTopicSettings(visible=True),
            "/pose/true": fl.BaseRendererPoseTopicSettings(visible=True, type="axis"),
        },
    )
)
WORDS = fl.LogPanel(config=fl.LogConfig(topic_to_render="/log"))
SETPOINTS = fl.PlotPanel(config=fl.PlotConfig(paths=setpoints("forward") + setpoints("up")))
DECISION = fl.RawMessagesPanel(config=fl.RawMessagesConfig(topic_path="/decision.reading"))

print(
    fl.Layout(
        content=fl.SplitContainer(
            direction="row",
            items=[
                panel(2, fl.SplitContainer(direction="column", items=[panel(3, CAMERA), panel(2, WORDS)])),
                panel(
                    3,
                    fl.SplitContainer(
                        direction="column",
                        items=[
                            panel(3, WORLD),
                            panel(2, fl.SplitContainer(direction="row", items=[panel(2, SETPOINTS), panel(1, DECISION)])),
                        ],
                    ),
                ),
            ],
        )
    ).to_json()
)
