"""Processes side by side: what they give, what they say, and that none is left behind."""

import math
import multiprocessing
import operator
import os
import signal
import subprocess
import sys
import time
import warnings

import pytest

from profilefit.recipes.workers import Workers, cores
from tests.fixtures import slow

# Starts two processes that would sleep for a minute, prints their numbers, and waits for them.
SLEEPERS = """
import multiprocessing, signal, time
from profilefit.recipes.workers import Workers
if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # which a shell's & has ignored
    with Workers(2) as workers:
        begun = workers.each(time.sleep, [0.01, 0.01, 60, 60])
        next(begun)
        print(*(process.pid for process in multiprocessing.active_children()), flush=True)
        list(begun)
"""


# Sleeps, so that no process does all the jobs, and gives something of its own.
OF_PROCESS = "__import__('time').sleep(0.2) or __import__('os').%s"


@pytest.mark.parametrize("processes", [0, 1, 2, 3])
def test_every_job_is_done_once_whatever_the_processes(processes):
    with Workers(processes) as workers:
        assert dict(workers.each(math.factorial, range(8))) == dict(enumerate(map(math.factorial, range(8))))
        assert list(workers.each(operator.neg, [5])) == [(0, -5)]
        assert list(workers.each(operator.neg, [])) == []
        numbers = {number for _, number in workers.each(eval, [OF_PROCESS % "getpid()"] * 2 * processes)}
        assert len(numbers) == processes
        assert (os.getpid() in numbers) == (processes == 1)
    assert 1 <= cores() <= os.cpu_count()
    assert not any(map(_is_alive, numbers - {os.getpid()}))
    assert not multiprocessing.active_children()


@pytest.mark.parametrize("processes", [1, 2])
def test_errors_and_warnings_come_here(processes):
    with Workers(processes) as workers:
        with pytest.warns(UserWarning, match="from a job"):
            list(workers.each(warnings.warn, ["from a job"]))
        with pytest.raises(OverflowError, match="math range error"):
            list(workers.each(math.exp, [1.0, 1e9, 2.0]))
    assert not multiprocessing.active_children()


def test_a_process_that_is_ended_from_outside_is_missed():
    with Workers(2) as workers, pytest.raises(ChildProcessError, match="ended from outside"):
        list(workers.each(os._exit, [9, 9]))


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("by", ["SIGKILL", *slow("SIGINT", "SIGTERM")])
def test_no_process_outlives_the_one_that_started_it(by):
    """Ctrl-C reaches all of them, a kill only the first."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "start_new_session": True}
    with subprocess.Popen([sys.executable, "-c", SLEEPERS], **pipes) as one:
        started = list(map(int, one.stdout.readline().split()))
        assert len(started) == 2
        time.sleep(1.0)
        (os.killpg if by == "SIGINT" else os.kill)(one.pid, signal.Signals[by])
        _, said = one.communicate(timeout=20)
    assert one.returncode != 0
    assert said.count("Traceback") == (by == "SIGINT")  # that of the first
    deadline = time.monotonic() + 20
    while time.monotonic() < deadline and any(map(_is_alive, started)):
        time.sleep(0.05)
    assert not any(map(_is_alive, started))


def _is_alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="this system has no shares of cores")
def test_each_process_has_cores_of_its_own():
    """Of two or more, though a worker of the tests has one."""
    own = os.sched_getaffinity(0)
    os.sched_setaffinity(0, range(os.cpu_count()))
    try:
        if cores() < 2:
            pytest.skip("shares of two cores or more")
        with Workers(2) as workers:
            shares = workers.each(eval, [OF_PROCESS % "sched_getaffinity(0)"] * 4)
            first, second = {frozenset(share) for _, share in shares}
        assert first.isdisjoint(second)
        assert first | second <= os.sched_getaffinity(0)
        assert len(first) < cores()
    finally:
        os.sched_setaffinity(0, own)
