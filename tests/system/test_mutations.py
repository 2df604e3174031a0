"""Whatever stands in a file: it is refused in one line, or taken for data. Nothing read is run, or becomes code.

A failure names the seed: `mutations.KIND(seed)` are the bytes.
"""

from __future__ import annotations

import ast
import contextlib
import io
import json
import os
import re
import resource
import time
import traceback
from collections.abc import Callable, Iterator
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import mutations
import numpy as np
import pytest

from mcml_sim.errors import InputError, OutputError, StoreError
from mcml_sim.mcml_files import read_mci
from mcml_sim.results import read_results
from profilefit import recipe, record
from profilefit.choose import scene
from profilefit.commands.report import report
from profilefit.errors import ShaderError
from profilefit.inventory import find
from profilefit.measured import reading
from profilefit.shader import emit
from profilefit.shader.export import LANGUAGES, export

NAMED = (InputError, OutputError, ShaderError, StoreError)  # what a command says in one line
QUICK, ALL = 200, 10_000
LONGEST = 1.0  # [s] of this process
LARGEST = 500e6  # [bytes] by which reading one file may grow it
ROOM = 2_000_000_000  # [bytes] beyond which reading is stopped
LONGEST_LINE = 2000  # characters of a message
SHOWN = 8  # failures told in full
# What no terminal and no source text is to get: control characters but the line feed, line ends, marks that turn the
# direction of text, halves of characters.
CONTROL = re.compile("[\0-\x09\x0b-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff]")


@pytest.fixture(autouse=True)
def room():
    """A bound on this process's memory: what asks for more is a failure, and no other process's end."""
    before = resource.getrlimit(resource.RLIMIT_DATA)
    resource.setrlimit(resource.RLIMIT_DATA, (resident("VmData") + ROOM, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_DATA, before)


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """A folder to work in, where what a payload would make is seen."""
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    assert not list(tmp_path.rglob(f"*{mutations.CANARY}*"))


def read_profile(path: Path) -> object:
    return reading.read(path, "mm" if path.suffix == ".csv" else None)


def read_samples(path: Path) -> object:
    return record.read_arrays(path.with_suffix(".json"))


# Kind -> the ending of its files, what mutates it, and all that reads it.
KINDS: dict[str, tuple[str, Callable[[int], bytes], tuple[Callable[[Path], object], ...]]] = {
    "record": (".json", lambda seed: mutations.record(seed)[1], (lambda path: record.read(path, whole=True),)),
    "scene": (".toml", mutations.scene, (scene.read,)),
    "recipe": (".toml", mutations.recipe, (recipe.read,)),
    "table": (".csv", mutations.table, (read_profile,)),
    "results": (".npz", mutations.results, (read_results, read_profile)),
    "samples": (".npz", mutations.samples, (read_samples,)),
    "mco": (".mco", mutations.mco, (read_profile,)),
    "mci": (".mci", mutations.mci, (read_mci,)),
}


def resident(field: str) -> int:
    """VmRSS or VmHWM of this process [bytes]."""
    line = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith(field))
    return int(line.split()[1]) * 1024


@contextlib.contextmanager
def bounded(faults: list[str], told: str) -> Iterator[None]:
    """Note what takes too long, too much memory, or raises what no command tells in a line."""
    Path("/proc/self/clear_refs").write_text("5")  # the highest mark of memory becomes what there is now
    before, begin = resident("VmRSS"), time.process_time()
    try:
        yield
    except NAMED as error:
        text = str(error)
        if len(text.splitlines()) != 1 or len(text) > LONGEST_LINE:
            faults.append(f"{told}: {type(error).__name__} of {len(text.splitlines())} lines: {text[:300]!r}")
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt | pytest.fail.Exception):
            raise
        place = traceback.extract_tb(error.__traceback__)[-1]
        ours = [one for one in traceback.extract_tb(error.__traceback__) if "site-packages" not in one.filename]
        where = " < ".join(f"{Path(one.filename).name}:{one.lineno}" for one in reversed(ours[-3:]))
        faults.append(f"{told}: {type(error).__name__}: {str(error)[:120]!r} at {where or place}")
    took, grown = time.process_time() - begin, resident("VmHWM") - before
    if took > LONGEST:
        faults.append(f"{told}: took {took:.1f} s")
    if grown > LARGEST:
        faults.append(f"{told}: grew by {grown / 1e6:.0f} MB")


def require_none(faults: list[str]) -> None:
    assert not faults, f"{len(faults)} failures:\n" + "\n".join(faults[:SHOWN])


def reading_faults(kind: str, seeds: range, folder: Path) -> tuple[list[str], list[int]]:
    """What went wrong in reading files of a kind, and the seeds of those that were accepted."""
    ending, mutant, readers = KINDS[kind]
    path, faults, accepted = folder / f"one{ending}", list[str](), list[int]()
    for seed in seeds:
        path.write_bytes(mutant(seed))
        for read in readers:
            with bounded(faults, f"{kind} {seed}"):
                read(path)
                accepted.append(seed)
    return faults, accepted
