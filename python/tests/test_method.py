"""The method's own functions, with numbers worked by hand."""

import math

import pytest

import spf


def test_lift() -> None:
    # 10 m · (5/10)^1.8 = 2.872 m; U = 0.5, tan 45° = 1: 1.436 m to the right.
    there = spf.lift((0.75, 0.5), 5, camera=(960, 720, 90, 60))
    assert there["step_m"] == pytest.approx(2.872, abs=1e-3)
    assert there["right_m"] == pytest.approx(1.436, abs=1e-3) and there["up_m"] == pytest.approx(0)
    assert there["yaw_deg"] == pytest.approx(math.degrees(math.atan2(0.5, 1)))
    # Image centre, tilt 5°, 10 m: forward 9.96, up −0.87.
    down = spf.lift((0.5, 0.5), 10)
    assert down["forward_m"] == pytest.approx(9.962, abs=1e-3) and down["up_m"] == pytest.approx(-0.872, abs=1e-3)
    assert spf.lift((0.5, 0.5), 10, levelled=False)["up_m"] == pytest.approx(0)
    assert spf.lift((0.5, 0.5), 1, fixed_step_m=1.5)["step_m"] == 1.5
    with pytest.raises(spf.UsageError, match="outside the image"):
        spf.lift((1.5, 0.5), 5)
    with pytest.raises(spf.UsageError, match="no such camera"):
        spf.lift((0.5, 0.5), 5, camera=(960, 720, 190, 60))


def test_parse_reply() -> None:
    reply = spf.parse_reply("Here: {'status': 'navigating', 'point': [250, 500], 'depth': '6',}", family="gemini")
    assert reply["point"] == {"u": 0.5, "v": 0.25} and reply["depth"] == 6
    with pytest.raises(spf.UsageError, match="the reply cannot be used"):
        spf.parse_reply("I see nothing.")
    with pytest.raises(spf.UsageError, match="gemni") as caught:
        spf.parse_reply("{}", family="gemni")
    assert caught.value.hint is not None and "did you mean `gemini`?" in caught.value.hint


def test_prompt() -> None:
    text = spf.prompt("fly to the red crane", family="gemini", near_m=3.0)
    assert "fly to the red crane" in text
    assert spf.prompt("fly to the red crane") != spf.prompt("fly to the red crane", avoid=True)


def test_a_log_that_is_none() -> None:
    with pytest.raises(spf.UsageError, match="cannot read the log `none.mcap`"):
        spf.read_log("none.mcap")
