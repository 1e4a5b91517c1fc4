"""What the program that comes with the module does for it: flights of real drones, in the terminal of whoever calls, and questions about
images."""

import ctypes
import json
import os
import shutil
import signal
import subprocess
import sys
import sysconfig
import threading
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from spf._types import Error, UsageError

# Looked up before any fork: the child of a process with threads may not load a library.
_PRCTL = ctypes.CDLL(None).prctl if sys.platform == "linux" else None
_FLAGS = {"max_time_s": "--max-time", "max_decisions": "--max-decisions", "max_queries": "--max-queries", "max_cost_usd": "--max-cost"}


def program() -> str:
    """The path of the program of this wheel, or else of another one on the path."""
    name = "spf.exe" if os.name == "nt" else "spf"
    own = Path(sysconfig.get_path("scripts")) / name
    found = str(own) if own.exists() else shutil.which(name)
    if found is None:
        raise _wrong("the program `spf` is not there", "install the wheel, or build the program and put it on the PATH")
    return found


def _wrong(message: str, hint: str) -> UsageError:
    error = UsageError(f"{message}\n\nhint: {hint}")
    error.hint = hint
    return error


def fly(
    instruction: str,
    *,
    drone: str,
    vlm: str | None,
    out: str,
    avoid: bool | None,
    preset: str,
    video: bool,
    unattended: bool,
    flags: Sequence[str],
    **limits: float | None,
) -> None:
    """Flies, and returns when the drone has landed and the files are written; those of the folder `out` tell how it went.

    The program has the terminal meanwhile, with its keys; Ctrl-C there lands. Each interrupt of this process, as of a notebook's kernel,
    is one of the program: the first lands. On Linux, if this process ends, the program lands as well.
    """
    command = [program(), "fly", f"--drone={drone}", f"--out={out}", f"--preset={preset}"]
    if vlm is not None:
        command.append(f"--vlm={vlm}")
    if avoid is not None:
        command.append(f"--avoid={'on' if avoid else 'off'}")
    command += [f"{_FLAGS[name]}={value}" for name, value in limits.items() if value is not None]
    if not video:
        command.append("--no-video")
    command += [*flags, "--", instruction]
    # Whoever calls says it, whatever file and environment say.
    environment = {**os.environ, "SPF_UNATTENDED": "true" if unattended else "false"}
    with _Foreground() as foreground:
        code = foreground.run(command, environment)
    if foreground.interrupts > 0:
        raise KeyboardInterrupt
    if code == 2:
        raise _wrong("the drone was not flown", "the reason stands above, in the program's own words")
    if not (Path(out) / "summary.json").exists():
        raise Error(f"the program ended with status {code} and without its files: look at the drone, and into {out}")


def ground(
    images: Sequence[str | PathLike[str]],
    instruction: str,
    *,
    vlm: str | Sequence[str],
    out: str | PathLike[str] | None = None,
    avoid: bool = False,
    max_cost_usd: float | None = None,
    flags: Sequence[str] = (),
) -> list[dict[str, Any]]:
    """Asks VLMs where in images an instruction leads, as ``spf ground`` does.

    images: paths of PNG and JPEG files, folders of them, or videos. vlm: names as of ``--vlm``, ``exec:COMMAND`` for a program of one's
    own. out: the folder for the annotated images; without one they are deleted. avoid: obstacle boxes are requested as well.
    max_cost_usd: limit of the cost. flags: further ones of ``spf ground``.

    Returns a dict for each image: picture, annotated (path, or None without out) and answers, in each of which ``said`` has ``reply`` with target, point (u and
    v, fractions from the upper left corner) and depth, or ``nothing`` with the reason. Raises spf.UsageError for what the program refuses.
    """
    with TemporaryDirectory() as temporary:
        folder = Path(temporary) / "out" if out is None else Path(out)
        command = [program(), "ground", "--json", f"--output={folder}"]
        command.append(f"--vlm={vlm if isinstance(vlm, str) else ','.join(vlm)}")
        if avoid:
            command.append("--avoid")
        if max_cost_usd is not None:
            command.append(f"--max-cost={max_cost_usd}")
        command += [*flags, "--", *map(str, images), instruction]
        asked = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, encoding="utf-8")
    try:
        pictures: list[dict[str, Any]] = json.loads(asked.stdout)["pictures"]
    except (ValueError, KeyError):
        told = asked.stderr.strip().removeprefix("error: ")
        message, _, hint = told.partition("\n\nhint: ")
        raise _wrong(message or f"exit status {asked.returncode}", hint or "spf ground --help") from None
    if out is None:
        for picture in pictures:
            picture["annotated"] = None
    return pictures


class _Foreground:
    """The terminal, lent to the program: it reads keys there, and Ctrl-C reaches it alone. Interrupts of this process are passed on, and
    raise nothing until the program has ended."""

    def __init__(self) -> None:
        # Only the main thread may say what a signal does, and only there an interrupt is seen.
        self.is_main = threading.current_thread() is threading.main_thread() and os.name == "posix"
        self.is_lent = self.is_main and os.isatty(0) and os.tcgetpgrp(0) == os.getpgrp()
        self.parent = os.getpid()
        self.interrupts = 0
        self.child: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> "_Foreground":
        if self.is_main:
            self.interrupted = signal.signal(signal.SIGINT, self._interrupt)
        if self.is_lent:
            # To lend it, and to take it back from behind.
            self.stopped = signal.signal(signal.SIGTTOU, signal.SIG_IGN)
        return self

    def _interrupt(self, *_: object) -> None:
        self.interrupts += 1
        if self.child is not None:
            self.child.send_signal(signal.SIGINT)

    def run(self, command: list[str], environment: dict[str, str]) -> int:
        """Runs the program to its end, whatever is raised meanwhile; returns its exit status."""
        child = subprocess.Popen(command, env=environment, preexec_fn=self._begin if os.name == "posix" else None)
        try:
            self.child = child
            # Those that came before there was a program.
            for _ in range(self.interrupts):
                child.send_signal(signal.SIGINT)
            return child.wait()
        except BaseException:
            # As of a handler of another signal: the drone lands before it goes on.
            if os.name == "posix":
                child.send_signal(signal.SIGINT)
            child.wait()
            raise

    def _begin(self) -> None:
        """What the program's process does first: it is a group of its own with the terminal, and lands if this process ends."""
        if self.is_main:
            os.setpgid(0, 0)
        if self.is_lent:
            os.tcsetpgrp(0, os.getpid())
            signal.signal(signal.SIGTTOU, signal.SIG_DFL)
        if _PRCTL is not None:
            # PR_SET_PDEATHSIG
            _PRCTL(1, signal.SIGTERM)
            if os.getppid() != self.parent:
                os._exit(1)

    def __exit__(self, *_: object) -> None:
        if self.is_lent:
            os.tcsetpgrp(0, os.getpgrp())
            signal.signal(signal.SIGTTOU, self.stopped)
        if self.is_main:
            signal.signal(signal.SIGINT, self.interrupted)
