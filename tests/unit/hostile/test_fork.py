"""A fork of a process where JAX has worked ends with a named error, where it used to wait for ever; others work on."""

import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")

# Each asks for something else of JAX, in a process of its own, and says how that went.
WORK = """
import multiprocessing, os, sys, warnings
from mcml_sim import Grid, Layer, Medium, exact, simulate, simulate_orders
import profilefit

warnings.simplefilter("ignore")  # jax's own: that a fork is likely to hang
law = profilefit.load("burley")
half_space, grid = Medium((Layer(1.0, 1.0, 9.0, 0.0),)), Grid(0.1, 10)
WORKS = {
    "exact": lambda: exact.profile(0.5, 0.9),
    "law": lambda: law.profile(0.5, 0.9),
    "sampler": lambda: law.sampler.sample(0.5, 0.9),
    "simulate": lambda: simulate(half_space, grid, 100, workers=1, progress=False),
    "orders": lambda: simulate_orders(grid, 100, workers=1, progress=False),
}

def said(name):
    try:
        WORKS[name]()
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return "worked"

def in_fork(names):
    read, write = os.pipe()
    if (child := os.fork()) == 0:
        os.write(write, "\\n".join(map(said, names)).encode())
        os._exit(0)
    os.waitpid(child, 0)
    return os.read(read, 10_000).decode().splitlines()
"""
NAMED = "ForkError: this process was forked after JAX had worked in its parent"


def run(code: str) -> list[str]:
    done = subprocess.run([sys.executable, "-c", WORK + code], capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def test_a_fork_after_work_is_told_what_to_do():
    """os.fork and the fork method of multiprocessing; the parent goes on."""
    lines = run(
        "said('law')\nprint(*in_fork(WORKS), sep='\\n')\n"
        "with multiprocessing.get_context('fork').Pool(1) as pool: print(pool.map(said, ['exact'])[0])\n"
        "print(said('exact'))"
    )
    assert len(lines) == 7
    assert all(line.startswith(NAMED) and line.endswith("multiprocessing.get_context('spawn')") for line in lines[:-1])
    assert lines[-1] == "worked"


@pytest.mark.slow
def test_a_fork_before_any_work_works():
    lines = run("print(*in_fork(['exact', 'law']), sep='\\n')\nprint(said('law'))")
    assert lines == ["worked"] * 3
