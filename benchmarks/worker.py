"""Runs a problem in a process of its own, when told to: to see its memory, or to run beside another one.

`worker.py CORES ITEM` answers one line a line: `run PHOTONS SEED THREADS` -> seconds; `memory` -> peak bytes so far.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from profilefit.studies.tradeoff.stopwatch import pin

ITEMS = ("orders", "half space", "half space, r-z", "three layers", "three layers, r-z", "yardstick")


class Worker:
    """End here of a process that runs one item on some cores."""

    def __init__(self, item: str, cores: list[int]) -> None:
        command = [sys.executable, __file__, ",".join(map(str, cores)), item]
        self._process = subprocess.Popen(
            command, cwd=Path(__file__).parent, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *_: object) -> None:
        if self._process.stdin:
            self._process.stdin.close()
        self._process.wait()

    def start(self, photons: int, seed: int, threads: int) -> None:
        """Begin a run."""
        self._say(f"run {photons} {seed} {threads}")

    def seconds(self) -> float:
        """Wait for the run that was begun; return how long it took [s]."""
        return float(self._line())

    def memory(self) -> float:
        """Return the peak of the resident memory [bytes]."""
        self._say("memory")
        return float(self._line())

    def _say(self, line: str) -> None:
        if self._process.stdin is None:
            raise RuntimeError("the worker has no input")
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()

    def _line(self) -> str:
        line = self._process.stdout.readline() if self._process.stdout else ""
        if not line:
            raise RuntimeError("the worker ended early; its error stands above")
        return line


def peak_memory(item: str, photons: int, core: int) -> float:
    """Return the peak resident memory of a process that imports, compiles and runs one item [bytes]."""
    with Worker(item, [core]) as worker:
        worker.start(photons, 1, 1)
        worker.seconds()
        return worker.memory()


def serve(item: str) -> None:
    """Answer the lines of stdin."""
    run = _runner(item)
    for line in sys.stdin:
        order, *numbers = line.split()
        if order == "run":
            begin = time.perf_counter()
            run(*map(int, numbers))
            answer = time.perf_counter() - begin
        else:
            answer = _peak_memory_here()
        print(answer, flush=True)


def _peak_memory_here() -> float:
    """Return the peak of this process alone [bytes]: on Linux, getrusage gives the parent's where that is larger."""
    try:
        status = Path("/proc/self/status").read_text(encoding="utf-8")
    except OSError:  # no Linux; macOS counts in bytes
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
    (peak,) = (line.split()[1] for line in status.splitlines() if line.startswith("VmHWM:"))
    return 1024 * float(peak)


def _runner(item: str) -> Callable[[int, int, int], object]:
    # Imported late: first the process is pinned, for jax counts the cores when it makes its first array.
    import problems

    tally_rz = item.endswith("r-z")
    if item == "yardstick":
        return lambda photons, seed, threads: problems.yardstick(photons, True)(seed)
    if item == "orders":
        return problems.orders
    if item.startswith("half space"):
        return lambda photons, seed, threads: problems.half_space_tally(photons, tally_rz, seed, threads)
    return lambda photons, seed, threads: problems.layered_tally(photons, tally_rz, seed, threads)


if __name__ == "__main__":
    pin(*map(int, sys.argv[1].split(",")))
    serve(sys.argv[2])
