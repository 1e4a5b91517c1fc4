"""Flights: with the oracle, with functions of one's own, and what can go wrong."""

import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import spf

AHEAD = {"status": "navigating", "point": [480, 360], "depth": 2}
DONE = '{"status": "done"}'
OFFICE: dict[str, Any] = {"scene": "office", "out": "flight"}


def test_a_flight_is_that_of_the_command() -> None:
    flight = spf.fly("fly to the red crane", seed=7, out="module")
    program = Path(sys.executable).with_name("spf")
    command = [str(program), "fly", "fly to the red crane", "--seed", "7", "--no-video", "--out", "command"]
    assert subprocess.run(command, capture_output=True).returncode in (0, 3, 4)
    for name in ("decisions.jsonl", "summary.json", "trajectory.svg"):
        assert Path("module", name).read_bytes() == Path("command", name).read_bytes(), name
    assert flight.outcome == "reached" and flight.verified is True and flight.targets == ["red_crane"]
    assert flight.folder == Path("module") and flight.log_path.is_file() and flight.map_path.is_file()
    assert flight.summary["seed"] == 7 and flight.recording_problems == []
    assert "not a real VLM" in flight.announcements[0]
    assert "reached" in repr(flight) and "<svg" in flight._repr_html_()

    log = spf.read_log(flight.log_path)
    assert log.summary == flight.summary and not log.is_truncated
    assert [row.to_dict() for row in log.decisions] == [row.to_dict() for row in flight.decisions]
    times, poses = flight.trajectory
    assert times.shape == (len(poses),) and poses.shape[1] == 6 and (np.diff(times) > 0).all()
    assert np.array_equal(poses, log.trajectory.poses)
    flown = np.linalg.norm(np.diff(flight.true_trajectory.poses[:, :3], axis=0), axis=1).sum()
    assert flown > 0.9 * flight.summary["path_length_m"]


def test_decisions_are_shown_in_flight() -> None:
    seen: list[spf.Decision] = []
    flight = spf.fly("fly to the red crane", on_decision=seen.append, out="flight", max_time_s=15)
    assert [row.to_dict() for row in seen] == [row.to_dict() for row in flight.decisions]
    first = seen[0]
    assert first.number == 1 and first.text in repr(first) and first.reply and "red crane" in first.prompt
    assert isinstance(first.pose, spf.Pose) and first.pose.up > 1
    assert first.goal is None or isinstance(first.goal, spf.Pose)


def test_a_function_answers_and_its_image_is_not_copied() -> None:
    queries: list[spf.Query] = []
    images: list[np.ndarray[Any, Any]] = []

    def my_vlm(query: spf.Query) -> dict[str, Any] | str:
        queries.append(query)
        images.append(query.image)
        return AHEAD if len(queries) < 4 else DONE

    flight = spf.fly("fly to the door", vlm=my_vlm, **OFFICE)
    assert flight.outcome == "reached" and flight.summary["vlm"] == "python:my_vlm"
    assert flight.decisions[0].to_dict()["latency_s"] == 1.5
    query, image = queries[0], images[0]
    assert image.shape == (720, 960, 3) and image.dtype == np.uint8 and image.flags.c_contiguous
    assert not image.flags.writeable and not image.flags.owndata
    assert image.ctypes.data == query.image.ctypes.data
    with pytest.raises(ValueError):
        image[0, 0, 0] = 1
    assert query.instruction == "fly to the door" and query.instruction in query.prompt
    assert query.schema is not None and query.number == 0 and not query.confirming
    assert any(query.confirming for query in queries)
    assert query.near_m is not None and query.near_m > 0 and "answers" not in query.history
    later = queries[2].history
    assert later["answers"][-1]["said"] == "pointed" and later["since_image"]["moved_m"] > 0.1
    assert 0.3 < later["room"]["height"] < 3 and later["room"]["up"] > 0
    total = int(image.sum())
    queries.clear()
    del query
    assert int(image.sum()) == total > 0


def test_an_exception_of_a_function_lands_and_is_raised() -> None:
    def fails(query: spf.Query) -> str:
        raise KeyError("no model")

    with pytest.raises(KeyError, match="no model"):
        spf.fly("fly to the door", vlm=fails, **OFFICE)
    log = spf.read_log("flight/flight.mcap")
    assert log.summary is not None and log.summary["outcome"] == "aborted"

    def shows(decision: spf.Decision) -> None:
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        spf.fly("fly to the red crane", on_decision=shows, out="second")
    log = spf.read_log("second/flight.mcap")
    assert len(log.decisions) >= 1 and log.summary is not None and log.summary["outcome"] == "aborted"
    with pytest.raises(TypeError, match="not JSON serializable"):
        spf.fly("fly to the door", vlm=lambda query: {"point": {1, 2}}, scene="office", out="third")


def test_errors_have_the_programs_words_and_a_hint() -> None:
    for arguments, words, hint in (
        ({"scene": "citty"}, "cannot load the scene `citty`", "city"),
        ({"vlm": "oracle:perfekt"}, "invalid oracle", "did you mean `oracle:perfect`?"),
        ({"vlm": "gemni"}, "cannot use the VLM `gemni`", "did you mean `gemini`?"),
        ({"vlm": "human"}, "for the program alone", "spf fly --vlm"),
        ({"craft": "plane"}, "unknown craft", "quad or tello"),
        ({"start": (1, 2)}, "start must be", "start="),
        ({"start": (0, 9000, 3, 0)}, "not above the ground", "--start"),
        ({"preset": "best"}, "unknown preset", "default or paper"),
        ({"vlm": 7}, "name of a VLM or a function", "oracle"),
    ):
        with pytest.raises(spf.UsageError, match=words) as caught:
            spf.fly("fly to the red crane", out="refused", **arguments)
        assert isinstance(caught.value, ValueError) and caught.value.hint is not None
        assert hint in caught.value.hint and caught.value.hint in str(caught.value)
        assert not Path("refused").exists()
    with pytest.raises(spf.UsageError, match="unknown word `qwertzuiop`"):
        spf.fly("qwertzuiop")
    with pytest.raises(spf.UsageError, match='no use for "from above"'):
        spf.fly("fly to the taxi from above")
    assert spf.fly("fly to the taxi from above", anyway=True, max_time_s=5).summary["not_read"] == ["from above"]


def test_other_threads_run_while_flying() -> None:
    ticks, over = [0], threading.Event()

    def tick() -> None:
        while not over.wait(0.001):
            ticks[0] += 1

    thread = threading.Thread(target=tick)
    thread.start()
    try:
        spf.fly("fly to the red crane", out="flight")
    finally:
        over.set()
        thread.join()
    assert ticks[0] > 20


def test_two_threads_fly_the_same_as_one() -> None:
    def fly(name: str) -> None:
        spf.fly("fly to the red crane", seed=3, max_time_s=20, out=name)

    threads = [threading.Thread(target=fly, args=(name,)) for name in ("one", "two")]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    fly("three")
    decisions = [Path(name, "decisions.jsonl").read_bytes() for name in ("one", "two", "three")]
    assert decisions[0] and decisions[0] == decisions[1] == decisions[2]


# A flight that lasts for as long as its function takes, and one of a whole run of flights.
SLOW = "spf.fly('fly to the door', scene='office', vlm=lambda query: (print('asked', flush=True), time.sleep(600)), out='flight')"
LONG = "print('asked', flush=True)\n    while True: spf.fly('fly to the red crane', seed=(seed := seed + 1), out=f'{seed}')"


@pytest.mark.parametrize("flying", [SLOW, LONG])
def test_ctrl_c_lands_at_once(flying: str) -> None:
    # What a shell starts in the background ignores the signal, and so would the child.
    heeds = "import signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"
    code = f"{heeds}import spf, time\nseed = 0\ntry:\n    {flying}\nexcept KeyboardInterrupt: print('interrupted', flush=True)"
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None and process.stdout.readline() == "asked\n"
    time.sleep(0.5)
    began = time.monotonic()
    process.send_signal(signal.SIGINT)
    rest, _ = process.communicate(timeout=60)
    assert rest.splitlines()[-1] == "interrupted" and process.returncode == 0
    # Reading a log and, on a busy machine, waiting for a processor take their part.
    assert time.monotonic() - began < 5
    newest = max((path for path in Path().glob("*/summary.json")), key=os.path.getmtime)
    assert '"aborted"' in newest.read_text() or flying is LONG


def test_the_program_is_in_the_wheel() -> None:
    program = shutil.which("spf", path=str(Path(sys.executable).parent))
    assert program is not None
    assert subprocess.run([program, "--version"], capture_output=True, text=True, check=True).stdout.startswith("spf ")


class Square:
    """A policy that flies a square, and says what it has seen of it."""

    def __init__(self) -> None:
        self.sides = 0
        self.moves: list[str] = []

    def handle(self, event: spf.Query) -> spf.Step:
        self.moves = event.moves
        assert event.near_m is not None and 0.3 < event.history["room"]["height"] < 3
        if self.sides == 4:
            return spf.Done()
        self.sides += 1
        return spf.Move(forward=1.0, turn_deg=90)


def test_a_policy_flies_and_its_done_is_believed(tmp_path: Path) -> None:
    square = Square()
    flight = spf.fly("fly a square", scene="office", policy=square, out=tmp_path / "flight")
    assert flight.outcome == "reached" and len(flight.decisions) == 5
    assert square.moves[-1] == "dx 1, dy 0, dz 0, dyaw 90"
    assert flight.summary["policy"] == "python:Square"
    _, poses = flight.true_trajectory
    up = poses[poses[:, 2] > 0.9 * poses[:, 2].max()]
    assert np.hypot(*(up[-1, :2] - up[0, :2])) < 0.3
    assert 4.0 < np.hypot(*np.diff(up[:, :2], axis=0).T).sum() < 5.0


def test_a_policy_points_as_the_method_lifts(tmp_path: Path) -> None:
    def ahead(event: spf.Query) -> spf.Step:
        height, width, _ = event.image.shape
        assert event.lift((width / 2, height / 2), 4)["step_m"] == pytest.approx(1.92, abs=0.01)
        if event.number == 0:
            return spf.Point(width / 2, height / 2, 4)
        return spf.Hold() if event.number == 1 else spf.Done()

    flight = spf.fly("ahead", scene="office", policy=ahead, vlm_latency_s=0.5, out=tmp_path / "flight")
    assert [decision.to_dict()["latency_s"] for decision in flight.decisions] == [0.5] * 3
    _, poses = flight.true_trajectory
    # It drifts a little while it hovers.
    assert np.hypot(*(poses[-1, :2] - poses[0, :2])) == pytest.approx(1.92, abs=0.3)


@pytest.mark.parametrize(
    ("step", "words"),
    [
        (spf.Move(forward=6.0), "at most 5 m"),
        (spf.Move(turn_deg=float("nan")), "finite"),
        (spf.Move(turn_deg=200), "at most 180"),
        (spf.Point(-5, 10, 3), "outside the image of 960"),
        (spf.Point(5, 10, 11), "from 1 to 10"),
        ("forward", "spf.Move"),
    ],
)
def test_a_wrong_step_lands_and_is_raised(step: spf.Step, words: str, tmp_path: Path) -> None:
    with pytest.raises(spf.UsageError, match=words):
        spf.fly("ahead", scene="office", policy=lambda _: step, out=tmp_path / "flight")
    assert spf.read_log(tmp_path / "flight" / "flight.mcap").summary is not None


def test_policy_and_vlm_exclude_each_other() -> None:
    with pytest.raises(spf.UsageError, match="queries no VLM"):
        spf.fly("ahead", policy=lambda _: spf.Done(), vlm="oracle")
    with pytest.raises(spf.UsageError, match="method handle"):
        spf.fly("ahead", policy=5)  # type: ignore[arg-type]
    with pytest.raises(spf.UsageError, match="Square\\(\\)"):
        spf.fly("ahead", policy=Square)  # type: ignore[arg-type]
    with pytest.raises(spf.UsageError, match="vlm_latency_s is that of a function"):
        spf.fly("ahead", vlm="oracle", vlm_latency_s=3)
    with pytest.raises(spf.UsageError, match="depth_sensor"):
        spf.fly("ahead", policy=Square(), avoid=True)
    hold: object = spf.Hold()
    assert hold != spf.Done()


def test_what_is_no_reply_is_refused(tmp_path: Path) -> None:
    replies: list[Any] = [[1, 2], None, spf.Done()]
    for number, reply in enumerate(replies):

        def wrong(query: spf.Query, reply: Any = reply) -> Any:
            return reply

        with pytest.raises(spf.UsageError, match="the function that is the VLM returned"):
            spf.fly("ahead", scene="office", vlm=wrong, out=tmp_path / f"flight-{number}")
