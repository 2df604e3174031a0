"""Seconds of compiling, told from those of running."""

import threading
import time

import jax
import jax.numpy as jnp
import pytest

from mcml_sim.runs.input_runs import EVENTS, Compiling


def test_the_first_call_compiles_and_the_second_does_not():
    def slow_to_compile(x):
        for power in range(60):
            x = jnp.sin(x + power) * jnp.where(x > power, x, -x)
        return x

    compiled, argument = jax.jit(slow_to_compile), jnp.ones(3)
    begun = time.perf_counter()
    with Compiling() as first:
        compiled(argument).block_until_ready()
    elapsed = time.perf_counter() - begun
    assert 0.5 * elapsed < first.seconds <= elapsed
    with Compiling() as second:
        compiled(argument).block_until_ready()
    assert second.seconds == 0


def test_threads_that_compile_at_once_count_once():
    def compile_slowly():
        begun = time.perf_counter()
        time.sleep(0.3)
        jax.monitoring.record_event_duration_secs(EVENTS + "anything", time.perf_counter() - begun)
        jax.monitoring.record_event_duration_secs("/something/else", 1000.0)

    threads = [threading.Thread(target=compile_slowly) for _ in range(4)]
    begun = time.perf_counter()
    with Compiling() as compiling:
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert 0.3 <= compiling.seconds <= time.perf_counter() - begun


def test_what_lies_apart_adds_up(monkeypatch):
    with Compiling() as compiling:
        for now, duration in ((10.0, 2.0), (9.5, 1.0), (13.0, 2.0), (12.5, 2.0)):  # 8-10 with 8.5-9.5; 10.5-13
            monkeypatch.setattr(time, "perf_counter", lambda now=now: now)
            jax.monitoring.record_event_duration_secs(EVENTS, duration)
    assert compiling.seconds == pytest.approx(4.5)
