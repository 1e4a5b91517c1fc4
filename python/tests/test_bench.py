"""Trials of many tasks."""

import json
from pathlib import Path

import pytest

import spf

TASK = "trial-office-armchair"


def ahead(query: spf.Query) -> dict[str, object]:
    return {"status": "done"} if query.number > 1 else {"status": "navigating", "point": [480, 360], "depth": 2}


def test_a_function_is_the_vlm_of_trials_and_a_second_call_flies_nothing(tmp_path: Path) -> None:
    told: list[int] = []

    def counted(query: spf.Query) -> dict[str, object]:
        told.append(query.number)
        return ahead(query)

    run = spf.bench.run(tasks=[TASK], vlm=counted, trials=2, seed=3, out=tmp_path / "run")
    assert [row["seed"] for row in run.rows] == [3, 4] and len(told) >= 6
    assert {row["vlm"] for row in run.rates} == {"python-counted"}
    assert run.rates[-1]["strict"]["of"] == 2 and "python-counted" in repr(run) and "<td>" in run._repr_html_()
    head = json.loads((tmp_path / "run" / "run.json").read_text())
    called = 'spf.bench.run(tasks=["trial-office-armchair"], name="python:counted", vlm_latency_s=1.5, trials=2, seed=3)'
    assert called in head.values()
    before = len(told)
    with pytest.warns(UserWarning, match="2 of 2 trials are those"):
        again = spf.bench.run(tasks=TASK, vlm=counted, trials=2, seed=3, out=tmp_path / "run")
    assert again.rows == run.rows == spf.bench.read(tmp_path / "run").rows and len(told) == before
    with pytest.raises(spf.UsageError, match="different settings"):
        spf.bench.run(tasks=[TASK], vlm=counted, name="changed", trials=2, seed=3, out=tmp_path / "run")
    with pytest.raises(spf.UsageError, match="different settings"):
        spf.bench.run(tasks=[TASK], vlm=counted, trials=3, seed=3, out=tmp_path / "run")


def test_a_policy_is_compared_with_spf_on_the_same_starts(tmp_path: Path) -> None:
    def turns(query: spf.Query) -> spf.Step:
        return spf.Done() if query.number > 3 else spf.Move(forward=0.5, turn_deg=20)

    mine = spf.bench.run(tasks=[TASK], policy=turns, trials=2, out=tmp_path / "mine")
    theirs = spf.bench.run(tasks=[TASK], vlm="oracle:perfect", trials=2, out=tmp_path / "spf")
    for one, other in zip(mine.rows, theirs.rows, strict=True):
        assert one["start_pose"] == other["start_pose"]
    [pair] = spf.bench.compare(mine, theirs)
    assert pair["first"] == "plain-numeric python-turns" and pair["second"] == "spf-default oracle-perfect"
    assert pair["points"] <= 0 and pair["low"] <= pair["points"] <= pair["high"]


def test_suites_have_their_tasks() -> None:
    assert TASK in spf.bench.suites()["trials"] and len(spf.bench.suites()["paper"]) == 34
    assert {"city", "office"} <= set(spf.scenes())


def test_exceptions_stop_a_run_and_wrong_names_are_refused(tmp_path: Path) -> None:
    def fails(query: spf.Query) -> str:
        raise KeyError(query.instruction)

    with pytest.raises(KeyError):
        spf.bench.run(tasks=[TASK], vlm=fails, trials=2, out=tmp_path / "run")
    assert spf.bench.read(tmp_path / "run").rows == []
    for arguments, words in [
        ({"suite": "papr"}, "did you mean `paper`"),
        ({"tasks": ["trial-office-armchar"]}, "did you mean `trial-office-armchair`"),
        ({"tasks": [TASK], "methods": ["spf-defult"]}, "did you mean `spf-default`"),
        ({"tasks": [TASK], "vlm": "oracle:default", "vlm_latency_s": 2}, "oracle:default@2s"),
        ({}, "no task"),
    ]:
        with pytest.raises(spf.UsageError, match=words):
            spf.bench.run(out=tmp_path / "wrong", **arguments)  # type: ignore[arg-type]
