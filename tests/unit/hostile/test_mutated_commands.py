"""Commands on mutated files, as processes: they end with 0, 1 or 2, refuse in one line, and then leave nothing."""

from __future__ import annotations

import itertools
import shutil
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from tests.unit.hostile import mutations, processes
from tests.unit.hostile.test_mutations import ALL, CONTROL, KINDS, NAMED, require_none

# Kind -> module, arguments of the command, and how many of those that are not refused may run: some take minutes.
AS_PROCESSES: dict[str, tuple[str, tuple[str, ...], int]] = {
    "export": ("profilefit", ("export", "NAME", "--fits", ".", "--lang", "python", "--out", "out.txt"), 200),
    "report": ("profilefit", ("report", "NAME", "--fits", ".", "-q"), 200),
    "scene": ("profilefit", ("choose", "FILE", "-q"), 2),
    "photo": ("profilefit", ("photo", "--simulate", "FILE", "--out", "mine", "-q"), 2),
    "facts": ("profilefit", ("fit", "FILE", "--out", "mine", "-q"), 2),
    "phase": ("profilefit", ("fit", "FILE", "--kind", "phase", "--out", "mine", "-q"), 1),
    "recipe": ("profilefit", ("regenerate", "FILE", "--photons", "1000", "--out", "mine", "-q"), 1),
    "table": ("profilefit", ("fit", "FILE", "--unit", "mm", "--out", "mine", "-q"), 5),
    "results": ("profilefit", ("fit", "FILE", "--out", "mine", "-q"), 5),
    "mci": ("mcml_sim", ("run", "FILE", "--photons", "1000", "--out", "mine", "-q"), 5),
    "mci2": ("mcml_sim", ("run", "FILE", "--photons", "1000", "--out", "mine", "-q"), 2),
}
PROCESSES = ALL // 50
BESIDE = 2
ARRAYS_WORDS = ("Traceback", "encountered in", "divide by zero", "RuntimeWarning", "site-packages")


def process_faults(kind: str, count: int, folder: Path) -> list[str]:
    """Run a command on so many mutated files, each in a folder of its own, a few side by side."""
    seeds = list(_seeds(kind, count, folder))
    shares = [seeds[part::BESIDE] for part in range(BESIDE)]
    with ThreadPoolExecutor(BESIDE) as pool:
        found = pool.map(lambda part: _faults_of(kind, shares[part], folder / f"part{part}"), range(BESIDE))
        return [fault for faults in found for fault in faults]


def _faults_of(kind: str, seeds: Sequence[int], folder: Path) -> list[str]:
    module, arguments, _ = AS_PROCESSES[kind]
    ending, mutant, _ = KINDS["record" if kind in ("export", "report") else kind]
    faults: list[str] = []
    folder.mkdir()
    with processes.commands(folder) as program:
        for seed in seeds:
            here = folder / str(seed)
            here.mkdir()
            name = mutations.record(seed)[0] if ending == ".json" else "one"
            (here / f"{name}{ending}").write_bytes(mutant(seed))
            told = [{"NAME": name, "FILE": f"{name}{ending}"}.get(word, word) for word in arguments]
            ended = program.run(module, told, here)
            faults += [f"{kind} {seed}: {text}" for text in _ended_wrong(ended, here, f"{name}{ending}")]
            shutil.rmtree(here)
    return faults


def _seeds(kind: str, count: int, folder: Path) -> Iterator[int]:
    """Seeds of `count` files, of which only so many are accepted when they are read."""
    answered = AS_PROCESSES[kind][2]
    ending, mutant, readers = KINDS["record" if kind in ("export", "report") else kind]
    path, given = folder / f"one{ending}", 0
    for seed in itertools.count(ALL):
        path.write_bytes(mutant(seed))
        refused = False
        try:
            for read in readers:
                read(path)
        except NAMED:
            refused = True
        if refused or answered > 0:
            answered -= not refused
            given += 1
            yield seed
        if given == count:
            return


def _ended_wrong(ended: processes.Ended, folder: Path, given: str) -> Iterator[str]:
    """What is wrong with how a command ended, and with what it left."""
    left = {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()} - {given}
    if ended.status not in (0, 1, 2):
        yield f"status {ended.status}: {ended.stderr[-300:]!r}"
    if ended.status == 2 and (len(ended.stderr.splitlines()) != 1 or not ended.stderr.endswith("\n")):
        yield f"{len(ended.stderr.splitlines())} lines on stderr: {ended.stderr[:300]!r}"
    if ended.status == 2 and (left or ended.stdout):
        yield f"refused, yet left {sorted(left)[:5]} and printed {ended.stdout[:100]!r}"
    if ended.status == 1 and not ended.stdout:
        yield f"status 1 without an answer: {ended.stderr[:300]!r}"
    if words := [word for word in ARRAYS_WORDS if word in ended.stderr]:
        yield f"{words[0]!r} on stderr: {ended.stderr[:300]!r}"
    if CONTROL.search(ended.stdout + ended.stderr):
        yield f"control characters: {CONTROL.findall(ended.stdout + ended.stderr)[:5]}, {ended.stderr[:200]!r}"
    if strange := [path for path in left if path.endswith((".part", ".tmp")) or mutations.CANARY in path]:
        yield f"left {strange}"


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("kind", AS_PROCESSES)
def test_as_processes(kind, elsewhere):
    require_none(process_faults(kind, PROCESSES, elsewhere))
