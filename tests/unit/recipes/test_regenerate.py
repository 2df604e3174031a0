"""Running recipes: checks before, what is traced, processes side by side; and records made again, compared."""

import json
import math
import multiprocessing
import operator
import os
import shutil
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import pytest

from mcml_sim import Setting
from profilefit.errors import RecipeError
from profilefit.recipes import recipe
from profilefit.recipes.folder import fits_folder
from profilefit.recipes.kinds import KINDS, albedo_map, law
from profilefit.recipes.regenerate import compared, regenerate, reproduction, requests_of, stated_error
from profilefit.recipes.run import PHOTONS, REFRACTED_PHOTONS, RecipeRun
from profilefit.recipes.workers import Workers, cores
from tests.fixtures import slow

FITS = fits_folder()


def test_recipes_are_checked_before_any_photon_is_traced(tmp_path):
    bad = tmp_path / "bad.toml"
    bad.write_text((FITS / "liang-whole.toml").read_text().replace('"corrected"', '"improved"'))
    said: list[str] = []
    run = RecipeRun("quick", 0, tmp_path / "out", tmp_path / "store", 1000, said.append, False)
    with pytest.raises(RecipeError, match="start must be one of published, corrected, got 'improved'"):
        regenerate(requests_of(["albedo-liang", str(bad)]), run)
    assert not said
    assert not Path(tmp_path / "store").exists()


def test_each_setting_is_traced_once_and_only_if_a_recipe_needs_it(monkeypatch, tmp_path):
    made = []

    def pipeline(chosen, run, light):
        made.append((chosen.name, light and light.setting))
        return {"constants": {}}, {}

    said: list[str] = []
    run = RecipeRun("quick", 0, tmp_path / "out", None, 1000, said.append, False)
    refracted, diffuse = Setting(n=1.4), Setting("diffuse")
    profile, exactly = recipe.find("burley-whole", FITS), recipe.find("albedo-rational", FITS).changed(check="")
    recipes = (
        profile.changed("profile-n1.4.toml", setting_table={"n": 1.4}),
        profile.changed("profile-diffuse.toml", truth="exact", setting_table={"illumination": "diffuse"}),
        exactly.changed("albedo-n1.4.toml", truth="orders", setting_table={"n": 1.4}),
        exactly,
        exactly.changed("checked.toml", setting_table={"illumination": "diffuse"}, check="orders"),
    )
    monkeypatch.setitem(albedo_map.PIPELINES, "albedo", pipeline)
    monkeypatch.setitem(law.PIPELINES, "profile", pipeline)
    by_key = {kind.key: kind for kind in KINDS}
    keys = {"albedo": "albedo_map", "profile": "law"}
    written = regenerate([(by_key[keys[one.pipeline]], one) for one in recipes], run)
    assert [line for line in said if "photons:" in line] == [f"1e+03 photons: {one}" for one in (refracted, diffuse)]
    maps = [("albedo-n1.4", refracted), ("albedo-rational", None), ("checked", diffuse)]
    assert made == [*maps, ("profile-n1.4", refracted), ("profile-diffuse", None)]
    names = [name for name, _ in made]
    assert [step.name for step in written] == [f"photons: {refracted}", f"photons: {diffuse}", *names]
    assert [step.path.stem for step in written[2:]] == names
    assert [line.split(":")[0] for line in said[2:]] == names


@pytest.mark.slow
def test_records_are_the_same_bytes_whatever_the_processes(tmp_path):
    """Maps, a fit to photons, and what compares the records of all."""
    names = ("albedo-liang", "albedo-rational", "burley-whole", "reproduction")
    requests = requests_of(names)
    for processes in (1, 2, 3):
        run = RecipeRun("quick", 5, tmp_path / str(processes), tmp_path / "store", 200_000, lambda _: None, False)
        steps = regenerate(requests, run, processes=processes)
        assert all(step.seconds > 0 for step in steps)
        assert {step.path.stem for step in steps if step.path} == set(names)
    one, *others = [{p.name: p.read_bytes() for p in tmp_path.glob(f"{processes}/*.*")} for processes in (1, 2, 3)]
    assert len(one) == 7  # what compares records has no arrays
    assert others == [one, one]


# Photons of each setting

SETTINGS = {Setting(): "", Setting("diffuse"): "diffuse"}
SETTINGS |= {Setting(n=1.4): "n1.4", Setting("diffuse", n=1.4): "diffuse-n1.4"}


@pytest.mark.slow
def test_every_setting_has_its_own_store_and_resumes(tmp_path):
    run = RecipeRun("quick", 3, tmp_path / "out", tmp_path / "photons", 2000, progress=False)
    for setting, folder in SETTINGS.items():
        light = run.light(setting)
        assert (light.setting, light.photons, light.seed) == (setting, 2000, 3)
        batches = sorted((run.store / folder).glob("batch-*"))
        assert len(batches) == 1
        before = batches[0].stat().st_mtime_ns
        assert np.array_equal(run.part().light(setting).counts.exits, light.counts.exits)
        assert batches[0].stat().st_mtime_ns == before
    assert len(list(run.store.rglob("batch-*"))) == len(SETTINGS)


def test_presets_give_surfaces_that_refract_fewer_photons(tmp_path):
    for preset in ("quick", "full"):
        traced = [RecipeRun(preset, 0, tmp_path, None, None, print).number(setting) for setting in SETTINGS]
        assert traced == [PHOTONS[preset]] * 2 + [REFRACTED_PHOTONS[preset]] * 2
        assert REFRACTED_PHOTONS[preset] < PHOTONS[preset]
    assert RecipeRun("full", 0, tmp_path, None, 7, print).number(Setting(n=1.4)) == 7


# Records made again beside the shipped ones

NAMES = {"burley-whole": 4, "albedo-liang": 3}  # constants; the second is of traced light


@pytest.fixture(scope="module", params=["burley-whole", *slow("albedo-liang")])
def made(tmp_path_factory, request):
    """A small record made again, by the command, optimised as for users: others' arithmetic takes twice as long."""
    folder = tmp_path_factory.mktemp("made")
    words = [sys.executable, "-m", "profilefit", "regenerate", request.param, "--out", str(folder)]
    done = subprocess.run(words, capture_output=True, text=True, check=True, env={**os.environ, "XLA_FLAGS": ""})
    assert "1 of 1 records reproduced; largest move" in done.stderr
    return folder / f"{request.param}.json"


def test_a_small_record_is_reproduced_and_compared_with_its_own_kind(made, tmp_path):
    found = reproduction(made, made.stem)
    assert (found.is_reproduced, found.constants) == (True, NAMES[made.stem])
    # Processors and the order of sums move a constant by 1e-5 of itself at most: its error is a hundredth of it.
    assert found.moved < 1e-3
    assert found.relative < 1e-5
    assert found.intervals < 1.0
    path, name = Path(shutil.copy(made, tmp_path)), made.stem
    path.write_text(json.dumps({**(of := json.loads(path.read_text())), "seed": of["seed"] + 1}))
    assert (reproduction(path, name), reproduction(path, "nothing-of-this-name")) == (None, None)
    assert reproduction(FITS / made.name, name) is None


@pytest.mark.parametrize(("share", "passes"), [(0.04, True), (0.06, False)])
def test_a_constant_that_moves_by_a_twentieth_of_its_error_is_not_reproduced(made, tmp_path, share, passes):
    """The negative control: the record that was made, one constant moved."""
    for ending in ("json", "npz"):
        shutil.copy(made.with_suffix(f".{ending}"), tmp_path)
    path = tmp_path / made.name
    content = json.loads(path.read_text())
    name, one = next((name, one) for name, one in content["constants"].items() if one["free"])
    one["regenerated"] += share * stated_error(one)
    path.write_text(json.dumps(content))
    found = reproduction(path, made.stem)
    assert found.is_reproduced is passes
    assert found.moved == pytest.approx(share, abs=0.005)
    assert passes or f"{name} moved by 0.06 of its stated error" in found.problem


def content(value=1.0, error=0.1, **more):
    return {"constants": {"a": {"regenerated": value, "model_error": error, **more}}, "fit": {"result": "converged"}}


def problem(shipped, other, chains=(), others=()):
    return compared("one", shipped, other, dict(chains), dict(others)).problem


def test_what_is_not_reproduced_is_named():
    """A constant that was not fitted must be equal."""
    assert compared("one", content(error=None), content(error=None), {}, {}).is_reproduced
    assert "a was not fitted and is" in problem(content(error=None), content(1 + 1e-10, error=None))
    assert "'degenerate' in place of 'converged'" in problem(content(), {**content(), "fit": {"result": "degenerate"}})


def of_chain(draws):
    levels = {"68%": np.quantile(draws, (0.16, 0.84)).tolist(), "95%": np.quantile(draws, (0.025, 0.975)).tolist()}
    return content(intervals={"misfit": levels}), {"misfit": draws[:, None]}


def test_intervals_of_two_right_chains_agree_and_of_a_shifted_one_do_not():
    """A thousand independent draws each: the allowance holds four ends at once, so 1 pair in 1000 may fail."""
    random = np.random.default_rng(5)
    found = []
    for _ in range(200):
        (one, draws), (other, again) = (of_chain(random.standard_normal(1000)) for _ in range(2))
        found.append(compared("one", one, other, draws, again).intervals)
    assert np.mean(np.array(found) > 1.0) <= 0.01
    assert np.median(found) > 0.2  # the allowance is no wider than the noise asks for
    (one, draws), (other, again) = of_chain(random.standard_normal(1000)), of_chain(random.standard_normal(1000) + 0.4)
    assert "the interval of a, misfit" in problem(one, other, draws, again)
    assert "the chain of misfit is in one record only" in problem(one, content(), draws)


# Processes side by side: what they give, what they say, and that none is left behind

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
        if processes > 1:
            with pytest.raises(ChildProcessError, match="ended from outside"):
                list(workers.each(os._exit, [9, 9]))
    assert not multiprocessing.active_children()


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
