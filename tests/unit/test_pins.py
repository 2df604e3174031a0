"""Today's bits and texts: what a change of names and places must not change.

`python -m tests.unit.test_pins` writes `data/pins.json` anew, for a change that means to move them: say so in the
changelog.
"""

import contextlib
import hashlib
import io
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mcml_sim
import profilefit
from mcml_sim.__main__ import main as simulator
from mcml_sim.runs.store import cpu_class
from profilefit.cli import main
from tests.fixtures import slow

ROOT = Path(__file__).resolve().parents[2]
PINS = Path(__file__).parent / "data" / "pins.json"
HELP = Path(__file__).parent / "data" / "help.txt"
LANGUAGES = ("glsl", "glsl-es", "hlsl", "python", "json")
SUBCOMMANDS = (
    *("fit", "photo", "choose", "convert", "scene", "export", "examples", "regenerate", "report", "check", "stability"),
    "tradeoff",
)
SLAB = mcml_sim.Medium(
    (mcml_sim.Layer(1.4, 0.5, 9.5, 0.8, 0.2), mcml_sim.Layer(1.3, 2.0, 8.0, -0.3, 0.3)), n_above=1.0, n_below=1.1
)
GRID = mcml_sim.Grid(0.1, 12, 0.05, 10, na=4)
PHOTONS = 20_000


def digest(*arrays) -> str:
    sha = hashlib.sha256()
    for array in arrays:
        sha.update(np.ascontiguousarray(array).tobytes())
    return sha.hexdigest()[:16]


def arithmetic() -> str:
    """Which bits this machine gives: processors round the functions that kernels call in their own ways."""
    x = jnp.linspace(0.01, 3.0, 4099, dtype=jnp.float32)
    ways = jax.jit(lambda v: (jnp.sin(v), jnp.exp(-v), jnp.log(v), jnp.sqrt(v), v * v + jnp.float32(0.1), 1 / v))(x)
    own = (way(np.asarray(x, float)) for way in (np.sin, np.exp, np.log, lambda v: v**0.7))
    return digest(cpu_class(), *ways, *own, np.linalg.svd(np.outer(x[:40], x[:30]) + np.eye(40, 30))[1])


def orders() -> str:
    run = mcml_sim.simulate_orders(
        mcml_sim.Grid.from_edges(r=np.append(0.0, np.geomspace(0.01, 30, 20))), PHOTONS, seed=3
    )
    return digest(run.counts.exits, run.profile([0.5, 0.99]).value)


def refracting() -> str:
    setting = mcml_sim.Setting("diffuse", n=1.4, g=0.5)
    run = mcml_sim.simulate_orders(mcml_sim.Grid(0.5, 20), PHOTONS, seed=4, setting=setting)
    return digest(run.counts.exits, run.reflectance(9 / 11).value)  # mu_s / (mu_s + mu_a) is 0.9


def layered() -> str:
    tally = mcml_sim.simulate(SLAB, GRID, PHOTONS, seed=5)
    return digest(tally.reflectance_ra.value, tally.absorbed_rz.value, tally.transmittance_r.standard_error)


def half_space() -> str:
    tally = mcml_sim.simulate(mcml_sim.half_space(0.9), mcml_sim.Grid(0.1, 20, 0.1, 10), PHOTONS, seed=6)
    return digest(tally.reflectance_r.value, tally.absorbed_rz.value, tally.diffuse_reflectance.standard_error)


def store() -> str:
    """Names and arrays of the files that a store holds, apart from the machine that made them."""
    with tempfile.TemporaryDirectory() as folder:
        mcml_sim.simulate_orders(mcml_sim.Grid(0.5, 20), PHOTONS, seed=7, store=folder)
        found = []
        for path in sorted(Path(folder).rglob("*")):
            found.append(path.name.encode())
            if path.suffix == ".npz":
                with np.load(path) as arrays:
                    names = sorted(set(arrays.files) - {"made_by"})
                    found += [bytes(name, "ascii") + arrays[name].tobytes() for name in names]
            elif path.suffix == ".json":
                content = json.loads(path.read_text())
                found += [json.dumps(content.get(key)).encode() for key in ("kind", "seed", "setting", "grid")]
    return hashlib.sha256(b"\0".join(found)).hexdigest()[:16]


def record() -> str:
    """The bytes of what `profilefit regenerate` makes of one recipe that needs no photons."""
    with tempfile.TemporaryDirectory() as folder:
        run("regenerate", "gaussians-2", "--out", folder, "--quiet")
        return hashlib.sha256((Path(folder) / "gaussians-2.json").read_bytes()).hexdigest()[:16]


BITS = {one.__name__: one for one in (orders, refracting, layered, half_space, store, record)}


def run(*words: str, program: Callable[[], None] = main) -> str:
    """What `profilefit WORDS`, or another program, prints, or says on stderr where it is refused."""
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        patch.setattr(sys, "argv", ["profilefit", *words])
        with contextlib.suppress(SystemExit):
            program()
    return out.getvalue() or err.getvalue()


def exports(*languages: str) -> dict[str, str]:
    """A digest of the text of every law and record in each language, or of why there is none.

    Of numbers in JSON, which are written to the last bit, nine digits count, as many as shaders have: processors sum
    matrices in their own ways.
    """
    names = [*profilefit.names(), *(path.stem for path in sorted((ROOT / "fits").glob("*.json")))]
    texts = {f"{name} {lang}": run("export", name, "--lang", lang) for name in names for lang in languages}
    for name, text in texts.items():
        if name.endswith(" json") and text.startswith("{"):
            texts[name] = json.dumps(json.loads(text, parse_float=lambda number: f"{float(number):.9g}"))
    return {name: hashlib.sha256(text.encode()).hexdigest()[:16] for name, text in texts.items()}


def help_texts() -> str:
    """Every --help, on a terminal of 80 columns."""
    mains = {"mcml_sim": simulator, "profilefit": main}
    lines = [["mcml_sim"], ["mcml_sim", "run"], ["profilefit"], *(["profilefit", name] for name in SUBCOMMANDS)]
    found = []
    with pytest.MonkeyPatch.context() as patch:
        for name, value in {"COLUMNS": "80", "TERM": "dumb", "NO_COLOR": "1"}.items():
            patch.setenv(name, value)
        for line in lines:
            out = run(*line[1:], "--help", program=mains[line[0]])
            found.append(f"$ {' '.join(line)} --help\n{out.rstrip()}\n")
    return "\n".join(found)


def of_a_process(*names: str) -> dict[str, str]:
    """Bits and arithmetic of a process whose programs are optimised, and its tables its own: those of tests are not."""
    code = f"from tests.unit import test_pins as t; print(t.json.dumps({{n: getattr(t, n)() for n in {names}}}))"
    with tempfile.TemporaryDirectory() as cache:
        environment = {**os.environ, "XDG_CACHE_HOME": cache, "XLA_FLAGS": ""}
        words = [sys.executable, "-c", code]
        return json.loads(subprocess.run(words, cwd=ROOT, env=environment, capture_output=True, check=True).stdout)


@pytest.fixture(scope="module")
def quick_bits():
    return of_a_process("arithmetic", *(name for name in BITS if name != "record"))


@pytest.mark.parametrize("name", [*(name for name in BITS if name != "record"), *slow("record")])
def test_bits_are_those_of_before(name, quick_bits):
    pins = json.loads(PINS.read_text())["bits"]
    if name not in pins.get(here := quick_bits["arithmetic"], {}):
        pytest.skip(f"arithmetic {here} of this machine has no pin of {name}")
    assert (quick_bits | of_a_process(name) if name == "record" else quick_bits)[name] == pins[here][name]


@pytest.mark.parametrize("language", [LANGUAGES[0], *slow(*LANGUAGES[1:])])
def test_texts_of_every_law_are_those_of_before(language):
    pins = {name: pin for name, pin in json.loads(PINS.read_text())["exports"].items() if name.split()[1] == language}
    now = exports(language)
    assert {name for name in pins.keys() | now.keys() if pins.get(name) != now.get(name)} == set()


def test_help_is_that_of_before():
    assert help_texts() == HELP.read_text(encoding="utf-8")


def test_a_pin_notices():
    """Negative control: another seed is another run."""
    grid = mcml_sim.Grid(0.5, 20)
    one, other = (mcml_sim.simulate_orders(grid, 1000, seed=seed).counts.exits for seed in (1, 2))
    assert digest(one) != digest(other)


if __name__ == "__main__":
    before = json.loads(PINS.read_text())["bits"] if PINS.exists() else {}
    bits = {**before, arithmetic(): {name: make() for name, make in BITS.items()}}
    PINS.write_text(json.dumps({"bits": bits, "exports": exports(*LANGUAGES)}, indent=1) + "\n")
    HELP.write_text(help_texts(), encoding="utf-8")
