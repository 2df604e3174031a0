"""mcml-sim as a user meets it: what it writes and prints, what it refuses, and in how many lines."""

import json
import math
import os
import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from mcml_sim import Estimate, Layer, Medium
from mcml_sim.cli import app
from mcml_sim.cli.app import FIRST_LOOKS, QUANTITIES, TOTALS
from mcml_sim.errors import ClusterError
from mcml_sim.files.version import __version__
from mcml_sim.media.grid import Grid
from mcml_sim.media.medium import half_space
from mcml_sim.results.mci import read_mci
from mcml_sim.results.tally import Precision, Results, quantities, read_results
from mcml_sim.runs import input_runs
from mcml_sim.runs.batches import FIRST_LOOK
from mcml_sim.runs.simulation import batch_photons, simulate
from mcml_sim.runs.store import RESUMES
from mcml_sim.tracing import layered_batch

# One layer and one grid for all tests: the tracer is compiled once.
RUN = """{name} A
{photons}
0.01 0.02
4 5 3
1
1.0
1.4 {mu_a} 90 0.5 0.05
1.0
"""
REMEDY = "use --out elsewhere, or delete it if that run is over\n"
KEPT = "stopped; the finished batches are kept, the same command resumes\n"


def runs(*rows: tuple[str, int, float]) -> str:
    text = "".join(RUN.format(name=name, photons=photons, mu_a=mu_a) for name, photons, mu_a in rows)
    return f"1.0 # version\n{len(rows)} # runs\n\n{text}"


@pytest.fixture
def command(program):
    return partial(program, "mcml-sim")


@pytest.fixture
def mci(tmp_path) -> Path:
    path = tmp_path / "two.mci"
    path.write_text(runs(("first.mco", 2000, 10), ("second.mco", 3000, 20)))
    return path


def totals(path: Path) -> list[float]:
    """The four numbers below RAT in an .mco file."""
    lines = path.read_text().partition("\nRAT ")[2].split("\n")[1:5]
    return [float(line.split()[0]) for line in lines]


def names(folder: Path = Path()) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


@pytest.mark.slow
def test_runs_everything_and_tells_it_with_errors(done, mci):
    out = done("run", mci)
    assert names() == {"two.mci", "first.mco", "first.npz", "second.mco", "second.npz"}
    told = out.split("run 2 of 2: second.mco")
    assert told[0].startswith("run 1 of 2: first.mco\n  2000 photons, seed 0, ")
    for text, name, run in zip(told, ("first", "second"), read_mci(mci), strict=True):
        assert re.search(r", [0-9.]+ s( and [0-9.]+ s to compile)?, [0-9.e-]+ (M )?photons/s\n", text)
        kept = read_results(f"{name}.npz")
        assert (kept.medium, kept.grid, kept.photons, kept.seed) == (run.medium, run.grid, run.photons, 0)
        rows = ("specular_reflectance", "diffuse_reflectance", "absorbed", "transmittance")
        np.testing.assert_allclose(totals(Path(f"{name}.mco")), [kept.estimates[row].value for row in rows], rtol=1e-5)
        for title, row in {
            "diffuse reflectance": "diffuse_reflectance",
            "absorbed fraction": "absorbed",
            "transmittance": "transmittance",
            "of it ballistic": "ballistic_transmittance",
            "all of these": "energy",
        }.items():
            found = re.search(rf"\n +{title} +([0-9.]+) ± ([0-9.]+)\n", text)
            estimate = kept.estimates[row]
            assert float(found[1]) == pytest.approx(estimate.value, abs=0.1 * estimate.standard_error), title
            assert float(found[2]) == pytest.approx(estimate.standard_error, rel=0.06), title
        assert re.search(r"\n  specular reflectance +0.0277778\n", text)


def test_photons_seed_and_folder_are_the_users(command, mci):
    for out, seed in (("a", 3), ("b", 3), ("c", 4)):
        assert command("run", mci, "--photons", 1000, "--seed", seed, "--out", out, "--workers", 1)[0] == 0
    assert names() == {"two.mci"} | {
        f"{out}/{n}.{end}" for out in "abc" for n in ("first", "second") for end in ("mco", "npz")
    }
    for name in ("first.mco", "second.npz"):
        a, b, c = (Path(out, name).read_bytes() for out in "abc")
        assert a == b
        assert a != c
    assert read_results("a/first.npz").photons == 1000


# The first layer and grid of `RUN`, in the format of MCML 2.
RUN_2 = """mcmli2.0
air 1.0 0 0 0
skin 1.4 5 90 0.5
end
{}
end
"""
ONE_2 = """{name} A
air
skin 0.05
air
end
pencil
0
0.01 0.02 0.1
4 5 1 3
Rd_r A_rz
{photons}
1E-4
{seed}"""


@pytest.mark.slow
def test_an_input_of_mcml_2_is_run_with_its_seed(command, done, tmp_path):
    ones = [ONE_2.format(name=f"two{seed}.mco", photons="2E3 0:10", seed=seed) for seed in (0, 3)]
    (tmp_path / "two.mci").write_text(RUN_2.format("\n".join(ones)))
    out = done("run", "two.mci", said="mcml-sim: two.mci: time limits end no run: each traces all its photons\n")
    assert "seed 0," in out
    assert "seed 3," in out
    (tmp_path / "one.mci").write_text(runs(("one.mco", 2000, 5.0)))
    assert command("run", "one.mci", "-q", "--seed", 3)[0] == 0
    mine, other, zero = (read_results(tmp_path / f"{name}.npz") for name in ("two3", "one", "two0"))
    assert (mine.seed, mine.medium, mine.grid) == (3, other.medium, other.grid)
    np.testing.assert_array_equal(mine.estimates["reflectance_r"].value, other.estimates["reflectance_r"].value)
    assert np.any(mine.estimates["reflectance_r"].value != zero.estimates["reflectance_r"].value)
    assert command("run", "two.mci", "-q", "--seed", 9) == (0, "", "")
    assert read_results(tmp_path / "two3.npz").seed == 9, "an option goes before the file"


@pytest.mark.slow
def test_results_of_another_run_are_replaced(command, mci):
    assert command("run", mci, "--seed", 3)[0] == 0
    before = Path("first.mco").read_bytes()
    assert command("run", mci)[0] == 0
    assert Path("first.mco").read_bytes() != before
    assert read_results("first.npz").seed == 0
    Path("first.mco").write_text("A1\nInParm\n")  # as V1 leaves it, not of this run
    Path("second.npz").write_bytes(b"")
    assert "finished before" not in command("run", mci)[1]
    assert totals(Path("first.mco"))[0] == pytest.approx(0.0277778)
    assert read_results("second.npz").photons == 3000


@pytest.mark.parametrize(
    ("name", "kept", "said"),
    [
        ("thesis.tex", "thesis.tex", "thesis.tex is there already, and no output of MCML"),
        ("a.mco", "a.mco", "a.mco is there already, and no output of MCML"),
        ("a.mco", "link:a.mco", "a.mco is there already, and no output of MCML"),
        ("a.mco", "a.npz", "a.npz is there already, and no results of mcml_sim"),
        ("a.mco", "pipe:a.npz", "a.npz is there already, and no results of mcml_sim"),
        ("a.mco", "a.photons/thesis.tex", "a.photons is there already, and holds thesis.tex, which is no batch of .*"),
        ("a.mco", "a.photons/run.json", "a.photons is there already, and holds run.json, which is no batch of .*"),
        ("a.mco", "a.photons/movie.mkv.part", "a.photons is there already, and holds movie.mkv.part, .*"),
    ],
)
def test_what_no_run_wrote_is_not_replaced(refused, mci, name, kept, said):
    """The first run could be done; it is not begun before the second one has passed."""
    mci.write_text(runs(("first.mco", 2000, 10), (name, 2000, 10)))
    how, _, place = kept.rpartition(":")
    path = Path(place)
    path.parent.mkdir(exist_ok=True)
    if how == "pipe":
        os.mkfifo(path)
    else:
        Path("old").write_text('{"old": 1}')
        (path.symlink_to if how else path.hardlink_to)("old")

    def there() -> dict[Path, tuple[int, ...]]:
        found = {one: one.lstat() for one in Path().rglob("*")}
        return {one: (each.st_ino, each.st_mode, each.st_size, each.st_mtime_ns) for one, each in found.items()}

    before = there()
    err = refused("run two.mci --photons 1000", "")
    assert re.fullmatch(f"mcml-sim: {said}: it is not replaced, use --out elsewhere\n", err), err
    assert there() == before


@pytest.mark.slow
def test_a_name_that_leads_elsewhere_takes_a_folder(command, mci, tmp_path):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    mci.write_text(runs((f"{elsewhere}/one.mco", 2000, 10), ("../two.mco", 2000, 10), ("sub/three.mco", 2000, 10)))
    assert command("run", mci, "--out", "o")[0] == 0
    ends = ("mco", "npz")
    assert names(Path("o")) == {f"{name}.{end}" for name in ("one", "two", "sub/three") for end in ends}
    assert not list(elsewhere.iterdir())


@pytest.mark.slow
def test_a_link_named_as_output_is_followed(command, mci):
    mci.write_text(runs(("first.mco", 2000, 10)))
    Path("sub").mkdir()
    Path("first.mco").symlink_to("sub/real.mco")
    assert command("run", mci)[0] == 0
    assert Path("first.mco").is_symlink()
    assert totals(Path("sub/real.mco"))[0] == pytest.approx(0.0277778)
    assert "finished before" in command("run", mci)[1]


@pytest.mark.slow
@pytest.mark.parametrize("more", [(), ("--resume",)])
def test_the_same_command_resumes(command, done, mci, monkeypatch, more):
    """Three batches a run, Ctrl-C in the middle of the second run: what is done is done once."""
    photons = 2 * layered_batch.BATCH_PHOTONS + 77
    words = ("run", mci, "--photons", photons)
    assert command(*words, "--out", "at-once")[0] == 0
    traced = []
    trace = layered_batch.trace_batch

    def interrupted(medium, grid, seed, batch, photons):
        if len(traced) == 4:
            raise KeyboardInterrupt
        traced.append(batch)
        return trace(medium, grid, seed, batch, photons)

    monkeypatch.setattr(layered_batch, "trace_batch", interrupted)
    assert command(*words, "--workers", 1)[::2] == (130, f"mcml-sim: {KEPT}")
    kept = {"first.mco", "first.npz", "second.photons/run.json", "second.photons/batch-00000000.npz"}
    assert {name for name in names() if not name.startswith("at-once")} == kept | {"two.mci"}

    monkeypatch.setattr(layered_batch, "trace_batch", lambda *given: traced.append(given[3]) or trace(*given))
    out = done(*words, *more)
    assert sorted(traced) == [0, 0, 1, 1, 2, 2]
    assert re.search(rf"run 1 of 2: first.mco\n  {photons} photons, seed 0, finished before\n  specular", out)
    assert re.search(rf"run 2 of 2: second.mco\n  {photons} photons, seed 0, [0-9.]+ s.*, resumed\n  specular", out)
    for name in ("first.mco", "first.npz", "second.mco", "second.npz"):
        assert Path(name).read_bytes() == Path("at-once", name).read_bytes()
    assert not list(Path().rglob("*.photons"))


@pytest.mark.parametrize("words", [("--seed", 1), ("--photons", 2001)])
def test_another_run_is_not_taken_for_finished(command, mci, words):
    assert command("run", mci)[0] == 0
    assert "finished before" not in command("run", mci, *words)[1]
    assert "finished before" in command("run", mci, *words)[1]


def test_batches_of_another_run_are_not_mixed_in(command, mci):
    words = ("run", mci, "--precision", 1e-4)
    assert command(*words)[0] == 0
    Path("first.npz").unlink()  # else they are but what a finished run left
    said = "mcml-sim: first.photons was made by another run: seed is 0 there, 5 here; " + REMEDY
    assert command(*words, "--seed", 5)[::2] == (2, said)


@pytest.mark.parametrize("words", [("--seed", 5), ("--photons", 2500), ("--precision", 1e-4), ()])
def test_a_precision_that_was_not_reached_blocks_no_run(command, done, mci, words):
    """Its photons wait for a run with more of them, until another one replaces its results."""
    mci.write_text(runs(("one.mco", 2000, 10)))
    assert command("run", mci, "--precision", 1e-4)[0] == 0
    assert Path("one.photons").is_dir()
    done("run", mci, *words)
    done("run", mci, "--precision", 1e-4, "--seed", 7)
    mci.write_text(runs(("one.mco", 2000, 20)))
    assert "finished before" not in done("run", mci, "--precision", 1e-4)


@pytest.mark.slow
def test_two_at_once_with_other_seeds_are_told_to_part(command, mci, monkeypatch):
    """Both begin before the other has a batch: nothing is mixed, and nobody is told to delete what is in use."""
    mci.write_text(runs(("one.mco", 2000, 10)))

    def second(medium, grid, photons, **options):
        simulate(medium, grid, 10, seed=5, store="one.photons")  # the other's first batch
        Path("one.photons/run.json").unlink()  # as if it had not been there when this one looked
        return simulate(medium, grid, photons, **options)

    monkeypatch.setattr(input_runs, "simulate", second)
    assert command("run", mci)[::2] == (
        2,
        "mcml-sim: one.photons/batch-00000000.npz was made by another run; if that is still at work, "
        "use --out elsewhere; if not, delete that file to redo just that batch\n",
    )
    assert not Path("one.mco").exists()


def test_another_runs_store_is_found_before_any_photon(command, refused, mci):
    assert command("run", mci, "--precision", 1e-4, "--out", "a")[0] == 0
    Path("b").mkdir()
    Path("a/first.photons").rename("b/second.photons")
    told = "mcml-sim: b/second.photons was made by another run: medium is .*mu_a=10.* there, .*mu_a=20.* here; "
    assert re.fullmatch(told + REMEDY, refused("run two.mci --out b", ""))
    assert "b/first.mco" not in names()


def test_a_run_that_ended_before_its_first_batch_is_in_nobodys_way(command, mci, monkeypatch):
    def dies(*_):
        raise RuntimeError("before the first batch")

    with monkeypatch.context() as change:
        change.setattr(layered_batch, "trace_batch", dies)
        status, _, err = command("run", mci)
    assert (status, "before the first batch" in err) == (70, True)
    assert "first.photons/run.json" in names()
    assert command("run", mci, "--seed", 8)[0] == 0
    assert read_results("first.npz").seed == 8


@pytest.mark.slow
def test_fewer_photons_do_not_cost_the_others(command, done, mci):
    photons = layered_batch.BATCH_PHOTONS + 77
    mci.write_text(runs(("one.mco", photons, 10)))
    assert command("run", mci, "--precision", 1e-5)[0] == 0
    kept = {path.name: path.read_bytes() for path in Path("one.photons").iterdir()}
    assert len(kept) == 3
    for _ in range(2):  # the second time it is done already
        out = done("run", mci, "--photons", 1000, said=None)
        assert "  one.photons is kept, since it holds more photons than these: more --photons use them" in out
        assert {path.name: path.read_bytes() for path in Path("one.photons").iterdir()} == kept
    said = "mcml-sim: one.photons was made by another run: seed is 0 there, 5 here; " + REMEDY
    assert command("run", mci, "--seed", 5)[::2] == (2, said), "the results of 1000 photons are finished, these are not"
    assert f"\n  {photons} photons, " in done("run", mci, said=None)
    assert not Path("one.photons").exists()


@pytest.mark.parametrize("written", ["3000", "3e3", "3000.0", "+3000"])
def test_whole_numbers_as_people_write_them(command, mci, written):
    assert command("run", mci, "--photons", written, "--seed", written)[0] == 0
    kept = read_results("first.npz")
    assert (kept.photons, kept.seed) == (3000, 3000)


def test_more_photons_or_more_repeats(done, mci):
    """Not reached: it says how many photons would, and they do, on top of those at hand."""
    mci.write_text(runs(("one.mco", 20_000, 10)))
    words = ("--precision", 2e-3, "--quantity", "absorbed")
    out = done("run", mci, *words, said=None)
    said = r"absorbed: relative standard error ([0-9.e-]+), not 0.002; about ([0-9.e+]+) photons in all"
    found = re.search(said, out)
    kept = read_results("one.npz").estimates["absorbed"]
    assert float(found[1]) == pytest.approx(kept.standard_error / kept.value, rel=0.05)
    assert float(found[2]) == pytest.approx(20_000 * (kept.standard_error / kept.value / 2e-3) ** 2, rel=0.05)
    assert "k runs of N photons with k seeds are worth one run of k N" in out
    assert Path("one.photons").is_dir()
    out = done("run", mci, "--photons", int(1.1 * float(found[2])), *words, said=None)
    assert "absorbed: relative standard error 0.002 reached" in out
    assert not Path("one.photons").exists()


def test_precision_stops_early_on_the_schedule(done, mci):
    mci.write_text(runs(("one.mco", 10**9, 10)))
    out = done("run", mci, "--precision", 0.01, said=None)
    assert f"\n  {8 * layered_batch.BATCH_PHOTONS} photons, " in out
    assert "diffuse_reflectance: relative standard error 0.01 reached" in out
    assert Precision(0.01).is_reached(read_results("one.npz").estimates["diffuse_reflectance"])


def test_a_quantity_without_light_has_no_answer(done, mci):
    mci.write_text(runs(("one.mco", 2000, 1000)))  # e^-54 gets through
    out = done("run", mci, "--precision", 0.01, "--quantity", "ballistic_transmittance", said=None)
    assert "ballistic_transmittance: 0.01 not reached; some bins hold too few photons to predict how many would" in out


def test_a_full_disk_is_one_line_and_nothing_half_written(command, mci, monkeypatch):
    mci.write_text(runs(("first.mco", 2000, 10)))
    sync = os.fsync

    def full(file):
        if "first.npz" in os.readlink(f"/proc/self/fd/{file}"):
            raise OSError(28, "No space left on device")
        sync(file)

    monkeypatch.setattr(os, "fsync", full)
    status, _, err = command("run", mci)
    assert status == 2
    assert err == "mcml-sim: cannot write first.npz: No space left on device\n"
    assert not [name for name in names() if name.endswith(".part")]
    assert "first.npz" not in names()
    monkeypatch.undo()
    assert command("run", mci.resolve(), "--out", mci.parent)[0] == 0
    assert read_results(mci.parent / "first.npz").photons == 2000


LEADS_OUT = "output files must lie in the current folder, or have a name and --out FOLDER, got "
OUTSIDE = "../y.mco", "/dev/null", "a/../../y.mco", "a/../y.mco"


@pytest.mark.parametrize(
    ("words", "outputs", "said"),
    [
        ("run", (), "Missing argument 'file'. .*"),
        ("run two.mci --photons many", (), "photons must be a whole number >= 1 .*, got 'many'"),
        ("run two.mci --photons 1e400", (), "photons must be a whole number >= 1 .*, got inf"),
        ("run two.mci --seed 0.5", (), "seed must be a whole number >= 0, got 0.5"),
        ("two.mci", (), "No such command 'two.mci'. [(]mcml-sim run two.mci does its runs[)]"),
        ("run two.mci --workers 0", (), "workers must be a whole number >= 1 and <= 4096, got 0"),
        ("run two.mci --precision nan", (), "precision must be .*, got nan"),
        ("run two.mci --quantity absorbed", (), "quantity must be left out without --precision, got 'absorbed'"),
        ("run two.mci --out two.mci", (), "cannot write into two.mci: .*"),
        ("run two.mci --out a/folder", (), "cannot write a/folder/first.mco: it is a folder"),
        ("run two.mci", ("two.mci",), "cannot write two.mci for two.mci: it belongs to the input file .*"),
        ("run two.mci", ("x.mco", "x"), "cannot write x.npz for x: it belongs to x.mco"),
        ("run two.mci", ("x.mco", "x.photons"), "cannot write x.photons for x.photons: it belongs to x.mco"),
        ("run two.mci --out o", ("/x/y.mco", "../y.mco"), "cannot write o/y.mco for ../y.mco: it belongs to /x/y.mco"),
        *(("run two.mci", ("x.mco", name), LEADS_OUT + re.escape(name)) for name in OUTSIDE),
        *(("run two.mci --out o", ("x.mco", name), LEADS_OUT + re.escape(name)) for name in ("..", "a/..", "/")),
    ],
)
def test_what_a_user_can_mend_is_one_line(refused, mci, words, outputs, said):
    if outputs:
        mci.write_text(runs(*((name, 9, 1) for name in outputs)))
    else:
        Path("a/folder/first.mco").mkdir(parents=True)
    before = names()
    assert re.fullmatch(f"mcml-sim: {said}\n", refused(words, ""))
    assert names() == before, "nothing was written"


def test_a_scheduler_is_passed_on(command, mci, monkeypatch):
    given = []

    def here(*what, scheduler, **options):
        given.append(scheduler)
        return simulate(*what, **options)

    monkeypatch.setattr(input_runs, "simulate", here)
    assert command("run", mci, "--scheduler", "tcp://10.0.0.1:8786")[0] == 0
    assert given == ["tcp://10.0.0.1:8786"] * 2


def test_the_remedy_is_the_command_lines_when_a_scheduler_leaves(command, mci, monkeypatch):
    def gone(*_, **__):
        raise ClusterError(f"the scheduler at here has gone; {RESUMES}")

    monkeypatch.setattr(input_runs, "simulate", gone)
    assert command("run", mci)[::2] == (2, "mcml-sim: the scheduler at here has gone; the same command resumes\n")


def test_json_is_the_totals_with_their_errors_and_nothing_else(command, done, mci):
    told = json.loads(done("run", mci, "--json"))["runs"]
    assert [one["mco"] for one in told] == ["first.mco", "second.mco"]
    for one in told:
        kept = read_results(one["npz"])
        assert (one["photons"], one["seed"], set(one["estimates"])) == (kept.photons, 0, {*TOTALS, "energy"})
        for name, estimate in one["estimates"].items():
            assert estimate["value"] == kept.estimates[name].value
            error = kept.estimates[name].standard_error
            assert estimate["standard_error"] == (error if np.isfinite(error) else None)
    out = command("run", mci, "--json", "--precision", 0.5, "--quantity", "absorbed")[1]
    reached = {"quantity": "absorbed", "goal": 0.5, "reached": True}
    assert [one["precision"] for one in json.loads(out)["runs"]] == [reached] * 2


def test_quiet_is_quiet(command, refused, mci):
    assert command("run", mci, "--quiet") == (0, "", "")
    assert names() == {"two.mci", "first.mco", "first.npz", "second.mco", "second.npz"}
    assert refused("run two.mci --quiet --seed x", "").startswith("mcml-sim: seed must be")


def test_what_the_help_says_is_what_is_done():
    assert quantities(Grid(1, 1, 1, 1, na=1)) == QUANTITIES
    first = [f"{FIRST_LOOK * batch_photons(half_space(0.5, n=n)) / 1e6:.2g} million" for n in (1.4, 1.0)]
    assert list(FIRST_LOOKS) == first


def test_version_and_help(command, done):
    assert command("--version") == (0, f"mcml-sim {__version__}\n", "")
    out = done("run", "--help", said=None)
    assert "--precision" in out
    assert "[default: (one per core)]" in out
    assert "[default: (diffuse_reflectance)]" in out
    assert re.search(r"first at\s+(│\s+│\s+)?2.1 million", out)
    assert command()[0] == 2


def test_a_value_with_two_digits_of_its_error():
    told = {
        (0.237834, 0.000421, 9): "0.23783 ± 0.00042",
        (1.0, 0.0, math.inf): "1",
        (0.0, 0.0, math.inf): "0",
        (0.0, 0.0, 0.0): "0 (no photon seen)",
        (0.5, math.inf, 1): "0.5 ± unknown",
        (9.83e-7, 9.83e-7, 1): "9.8e-07 ± 9.8e-07",
        (1.23456e-6, 1.2e-9, 9): "1.2346e-06 ± 1.2e-09",
        (2e-7, 3e-6, 1): "2e-07 ± 3.0e-06",
        (12.3, 4.56, 9): "12.3 ± 4.6",
        (1.0, 1e-15, 9): "1.000000000000 ± 0.000000000000",
    }
    assert {given: app.with_error(Estimate(*given)) for given in told} == told


def test_speed_leaves_out_compiling():
    told = {
        (10**6, 8.0, 3.9): "4.1 s and 3.9 s to compile, 0.244 M photons/s",
        (10**6, 4.1, 0.0): "4.1 s, 0.244 M photons/s",
        (20_000, 10.0, 0.01): "10.0 s, 2002 photons/s",
        (20_000, 1.0, 1.0): "0.0 s and 1.0 s to compile, 20 M photons/s",
    }
    for (photons, seconds, compiling), text in told.items():
        done = input_runs.Done(SimpleNamespace(photons=photons), seconds, compiling)
        assert app.pace(done, on_workers=False) == text


def test_light_that_was_cut_is_a_line_of_the_sum():
    estimates = dict.fromkeys((*TOTALS, "energy"), Estimate(0.2, 0.01, 99))
    medium = Medium((Layer(1, 1, 1, 0, 1),))
    kept = Results(medium=medium, grid=Grid(1, 1), photons=9, seed=0, version="", cut=0.1234, estimates=estimates)
    lines = list(app.totals(kept))
    assert lines[-2:] == ["at scattering limit    0.12", "all of these           0.200 ± 0.010"]
    assert len(list(app.totals(replace(kept, cut=0.0)))) == len(lines) - 1
