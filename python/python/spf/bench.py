"""Trials of many tasks: success rates with intervals, and comparisons on the same starts.

    import spf

    mine = spf.bench.run("paper", vlm=my_vlm, trials=3, out="mine")
    print(mine)

Tasks, methods and verdicts are those of ``spf bench``. The same seeds give the same starts, whoever
flies from them; tasks of the suite ``trials`` all start where their scene does.
"""

import warnings
from collections.abc import Callable, Sequence
from html import escape
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from spf._native import Query, bench_pairs, bench_rates, bench_rows, bench_run, bench_suites
from spf._types import Step

if TYPE_CHECKING:
    from spf._native import _Policy

__all__ = ["Run", "compare", "read", "run", "suites"]

HEAD = ("method", "VLM", "tasks", "strict", "paper", "collided")


class Run:
    """The trials of a folder."""

    def __init__(self, folder: str | PathLike[str], rows: list[dict[str, Any]]) -> None:
        self.folder = Path(folder)
        """The folder of the rows: ``results.jsonl``, ``paths.jsonl``."""
        self.rows = rows
        """One dict for each trial, as in ``results.jsonl``."""

    @property
    def rates(self) -> list[dict[str, Any]]:
        """Success rates by method and VLM: for each category and set of tasks, and overall with ``set`` None.

        Each has ``strict`` (done was said, and the goals were met), ``paper`` (at some instant it would have counted) and
        ``collided``, as dicts of hits, of, value, and the bounds low and high of the 95 % Wilson interval.
        """
        return bench_rates(self.rows)

    def to_pandas(self) -> Any:
        """The rows as a ``pandas.DataFrame``, nested fields with dots in their names. Needs pandas."""
        return import_module("pandas").json_normalize(self.rows)

    def _table(self) -> list[tuple[str, ...]]:
        def words(rate: dict[str, Any]) -> str:
            if not rate["of"]:
                return "0/0"
            shown = [f"{100 * rate[key]:.0f}" for key in ("value", "low", "high")]
            return f"{rate['hits']}/{rate['of']} = {shown[0]} % [{shown[1]}, {shown[2]}]"

        return [
            (line["method"], line["vlm"], line["group"], *(words(line[key]) for key in ("strict", "paper", "collided")))
            for line in self.rates
        ]

    def __repr__(self) -> str:
        rows = [HEAD, *self._table()]
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        return "\n".join("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows)

    def _repr_html_(self) -> str:
        head = "".join(f"<th>{name}</th>" for name in HEAD)
        rows = ("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in self._table())
        return f"<table><tr>{head}</tr>{''.join(rows)}</table>"


def run(
    suite: str | None = None,
    *,
    out: str | PathLike[str],
    tasks: str | Sequence[str] = (),
    methods: Sequence[str] = (),
    vlm: str | Sequence[str] | Callable[[Query], str | dict[str, Any]] | None = None,
    policy: "Callable[[Query], Step] | _Policy | None" = None,
    name: str | None = None,
    trials: int = 5,
    seed: int = 0,
    jobs: int | None = None,
    max_cost_usd: float | None = None,
    vlm_latency_s: float | None = None,
    progress: bool = True,
) -> Run:
    """Flies each task with each method and VLM, and returns the trials.

    suite: its tasks, such as ``"paper"``; tasks: names or files, in addition. ``spf bench list`` lists them.
    methods: by their names, by default ``spf-default``, the method as ``spf fly`` flies it. vlm: names, by default ``oracle:default``, or
    a function as of ``spf.fly``. policy: a policy of one's own in the place of methods and VLM, as of ``spf.fly``; its ``Done`` is asked
    for twice (``query.confirming``). In the rows it is the method ``plain-numeric``, whose answers are such moves.
    name: of the function or policy in the rows, by default its own.
    trials: of each task, from seeds seed, seed + 1, …. out: the folder for the rows. If it has trials of the same call, only the missing
    ones are flown; a function or policy is known by its name alone, so give another name or folder when it has changed.
    jobs: how many are flown at once, by default one for each core, but 1 with a function or policy: it is called in this thread, and with
    more jobs from several flights in turn. A flight begins with ``query.number == 0``. max_cost_usd: limit of the whole run.
    vlm_latency_s: the time that an answer of a function counts as having taken, by default 1.5 s, of a policy 0.1 s.
    progress: shows a bar, if tqdm is installed.

    An exception of a function stops the run and is raised, and so does Ctrl-C; finished trials are kept. Raises spf.UsageError for unknown
    names, and a folder of another call.
    """
    function = vlm if callable(vlm) else None
    names = [] if vlm is None or callable(vlm) else [vlm] if isinstance(vlm, str) else list(vlm)
    is_mine = function is not None or policy is not None
    bar = _bar() if progress else None
    began = False

    def tell(done: int, of: int) -> None:
        nonlocal began
        if not began and done > 0 and is_mine:
            kept = f"{done} of {of} trials are those that {out} has already; a function or policy is known by its name alone"
            warnings.warn(kept, stacklevel=3)
        began = True
        if bar is not None:
            bar.total = of
            bar.update(done - bar.n)

    try:
        rows = bench_run(
            suite,
            [tasks] if isinstance(tasks, str) else list(tasks),
            list(methods),
            names,
            function,
            name,
            policy,
            trials,
            seed,
            Path(out),
            1 if jobs is None and is_mine else jobs,
            max_cost_usd,
            vlm_latency_s,
            tell,
        )
    finally:
        if bar is not None:
            bar.close()
    return Run(out, rows)


def _bar() -> Any:
    try:
        return import_module("tqdm.auto").tqdm(unit="trial")
    except ImportError:
        return None


def read(folder: str | PathLike[str]) -> Run:
    """The trials in a folder of ``spf.bench.run`` or ``spf bench run``."""
    return Run(folder, bench_rows(Path(folder)))


def compare(first: Run, second: Run, *, verdict: Literal["strict", "paper"] = "strict") -> list[dict[str, Any]]:
    """Compares each method and VLM of one run with each of another, on the starts that both flew from.

    Each dict has first and second (method and VLM), points (success rate of the first minus that of the second, in percentage points)
    with the bounds low and high of its 95 % interval, only_first and only_second (starts from which only one succeeded), and p (exact
    McNemar test, with Holm's correction over all pairs). An oracle reads the simulator's ground truth: a difference to it says little
    about what a model would do.
    """
    return bench_pairs(first.rows, second.rows, verdict)


def suites() -> dict[str, list[str]]:
    """The names of the tasks of each suite. ``spf bench list`` has their instructions too."""
    return dict(bench_suites())
