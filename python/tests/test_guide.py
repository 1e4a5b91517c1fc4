"""The examples of the guide run as they stand, one after the other."""

import re
from pathlib import Path
from typing import Any

GUIDE = Path(__file__).with_name("python.md")
if not GUIDE.exists():
    GUIDE = Path(__file__).parents[2] / "docs" / "guide" / "python.md"


def test_the_examples_of_the_guide() -> None:
    names: dict[str, Any] = {}
    blocks = re.findall(r"^```python\n(.*?)^```$", GUIDE.read_text(), re.DOTALL | re.MULTILINE)
    assert len(blocks) > 5
    for block in blocks:
        exec(compile(block, str(GUIDE), "exec"), names)
    assert names["flight"].summary["vlm"] == "python:reddest"
    assert names["flight"].summary["path_length_m"] > 5
    assert names["own"].summary["policy"] == "python:TowardsTheReddest"
    assert names["own"].summary["path_length_m"] > 5
