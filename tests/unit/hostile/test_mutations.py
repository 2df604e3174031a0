"""Whatever stands in a file: it is refused in one line, or taken for data. Nothing read is run, or becomes code.

Commands on such files, as processes, end with 0, 1 or 2, refuse in one line, and then leave nothing.

A failure names kind and seed: `KINDS[kind][1](seed)` are the bytes. Slow tests read as many files of a kind as the
variable MUTATIONS says, 2,000 if it is not set: MUTATIONS=10000 make test-all ARGS="-k mutat".
"""

from __future__ import annotations

import ast
import contextlib
import gc
import io
import itertools
import json
import os
import re
import resource
import shutil
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from html.parser import HTMLParser
from importlib import import_module
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from mcml_sim.errors import InputError, OutputError, StoreError
from mcml_sim.files.whole_file import read_toml
from mcml_sim.results.mci import read_mci
from mcml_sim.results.tally import read_results
from profilefit.cli.report import report
from profilefit.errors import RecordError, ShaderError
from profilefit.measured import reading
from profilefit.measured.instrument import beam_of
from profilefit.measured.photo.setup import read_setup
from profilefit.measured.premises import premises
from profilefit.recipes import recipe, record
from profilefit.recipes.catalogue import LoadedLaw, find
from profilefit.recipes.kinds import gaussians, phase, stack
from profilefit.recipes.phases import read_phase
from profilefit.recipes.stack.file import read_layers
from profilefit.report.page.document import write_page
from profilefit.report.tables.claims_table import read_claims
from profilefit.scenes import SCENES
from profilefit.scenes.heart import scene as heart
from profilefit.scenes.skin import scene as skin
from profilefit.scenes.stage.subject.mesh_file import read_mesh
from profilefit.shader import emit
from profilefit.shader.law_file import LANGUAGES, export
from profilefit.studies.choose import requirements
from tests.fixtures import slow
from tests.unit.hostile import mutations, processes

# A record alone in its folder is normalised with the shipped map, and the command says so.
NAMED = (InputError, OutputError, ShaderError, StoreError)  # what a command says in one line
QUICK, ALL = 60, int(os.environ.get("MUTATIONS", "2000"))
LONGEST = 1.0  # [s] of this process
LARGEST = 500e6  # [bytes] by which reading one file may grow it
ROOM = 2_000_000_000  # [bytes] beyond which reading is stopped
LONGEST_LINE = 2000  # characters of a message
SHOWN = 8  # failures told in full
# What no terminal and no source text is to get: control characters but the line feed, line ends, marks that turn the
# direction of text, halves of characters.
CONTROL = re.compile("[\0-\x09\x0b-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff]")


@pytest.fixture(autouse=True, scope="module")
def own_garbage():
    """Collecting what earlier files left in a worker, gigabytes of it, takes a second: it is not in question here."""
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()
    gc.collect()
    gc.freeze()


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """A folder to work in, where what a payload would make is seen."""
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    assert not list(tmp_path.rglob(f"*{mutations.CANARY}*"))


@pytest.fixture(autouse=True)
def room():
    """A bound on this process's memory: what asks for more is a failure, and no other process's end."""
    before = resource.getrlimit(resource.RLIMIT_DATA)
    resource.setrlimit(resource.RLIMIT_DATA, (resident("VmData") + ROOM, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_DATA, before)


def read_profile(path: Path) -> object:
    return reading.read(path, "mm" if path.suffix == ".csv" else None)


def read_claims_of(path: Path) -> object:
    shutil.copy(path, path.with_name("claims.json"))
    return read_claims(path.parent)


def read_layers_of(path: Path) -> object:
    return read_layers(path, read_toml(path))


def read_scene(name: str) -> Callable[[Path], object]:
    return lambda path: import_module(SCENES[name][0]).read(str(path), read_toml(path))


def read_heart(path: Path) -> object:
    """A scene without its mesh, which takes more than a second."""
    with (
        mock.patch.object(heart.HeartRequest, "mesh", None),
        mock.patch.object(heart, "atlas_size", return_value=((1, 1), 0)),
    ):
        return heart.read(str(path), read_toml(path))


MESHES = "glb", "obj", "ply", "stl"
SAMPLES = mutations.arrays("fits/albedo-rational.npz")  # beside a record
# Kind -> the ending of its files, what mutates it, and all that reads it.
KINDS: dict[str, tuple[str, Callable[[int], bytes], tuple[Callable[[Path], object], ...]]] = {
    "record": (".json", lambda seed: mutations.record(seed)[1], (lambda path: record.read(path, whole=True),)),
    "stack-record": (".json", mutations.tree("fits/stacks/skin.json"), (stack.read,)),
    "sum-record": (".json", mutations.tree("fits/gaussians/skin.json"), (gaussians.load,)),
    "phase-record": (".json", mutations.tree("fits/phases/petzold.json"), (phase.load,)),
    "claims": (".json", mutations.tree("fits/evidence/claims.json"), (read_claims_of,)),
    "scene": (".toml", mutations.toml("examples/skin.toml"), (requirements.read,)),
    "head": (".toml", mutations.toml("examples/skin-head.toml"), (lambda path: skin.read(str(path), read_toml(path)),)),
    "layers": (".toml", mutations.toml("examples/layers-head.toml"), (read_layers_of, read_scene("layers"))),
    "heart": (".toml", mutations.toml("examples/heart.toml"), (read_heart,)),
    "sea": (".toml", mutations.toml("examples/sea.toml"), (read_scene("sea"),)),
    "fur": (".toml", mutations.toml("examples/fur.toml"), (read_scene("fur"),)),
    **{f"mesh-{one}": (f".{one}", mutations.mesh(one), (lambda path: read_mesh(path, 1.0),)) for one in MESHES},
    "photo": (".toml", mutations.toml("examples/photo.toml"), (read_setup,)),
    "recipe": (".toml", mutations.recipe, (recipe.read,)),
    "stack": (".toml", mutations.toml("fits/stacks/skin.toml"), (lambda path: stack.request(str(path)),)),
    "table": (".csv", mutations.table, (read_profile,)),
    "facts": (".csv", mutations.facts, (lambda path: premises(reading.read(path)),)),
    "beam": (".csv", mutations.beam, (lambda path: beam_of("beam", str(path), "mm"),)),
    "phase": (".csv", mutations.of_text("fits/phases/petzold.csv"), (read_phase,)),
    "translucency": (".txt", mutations.translucency, (lambda path: reading.read(path, None, True, "red"),)),
    "results": (".npz", mutations.arrays("examples/half_space.npz"), (read_results, read_profile)),
    "samples": (".npz", SAMPLES, (lambda path: record.read_arrays(path.with_suffix(".json")),)),
    "mco": (".mco", mutations.words("examples/half_space.mco"), (read_profile,)),
    "mci": (".mci", mutations.words("examples/slab.mci"), (read_mci,)),
    "mco2": (".mco", mutations.words(mutations.MCO_2, *mutations.MCI_2_WORDS), (read_profile,)),
    "mci2": (".mci", mutations.words(mutations.MCI_2, *mutations.MCI_2_WORDS), (read_mci,)),
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
        faults.append(f"{told}: {type(error).__name__}: {str(error)[:120]!r} at {_place(error)}")
    took, grown = time.process_time() - begin, resident("VmHWM") - before
    if took > LONGEST:
        faults.append(f"{told}: took {took:.1f} s")
    if grown > LARGEST:
        faults.append(f"{told}: grew by {grown / 1e6:.0f} MB")


def require_none(faults: list[str]) -> None:
    assert not faults, f"{len(faults)} failures:\n" + "\n".join(faults[:SHOWN])


# Tokens as GLSL and HLSL see them, once lines are joined and comments gone.
TOKEN = re.compile(r"[A-Za-z_]\w*|\.?\d(?:[eE][+-]|[\w.])*|[^\w\s]")
LITERAL = re.compile(r"\.?\d.*")


def tokens(text: str, joined: bool) -> list[list[str]]:
    """The tokens of each line that has any, numbers as 0 without sign; `joined` as a C preprocessor joins lines."""
    if joined:
        text = re.sub(r"(?:\\|\?\?/)[ \t]*(?:\r\n|\r|\n)", "", text)
    text = re.sub(r"//[^\r\n]*|/\*.*?\*/", " ", text, flags=re.DOTALL)
    lines = ([LITERAL.sub("0", one) for one in TOKEN.findall(line)] for line in re.split(r"[\r\n]", text))
    return [re.sub(r"(?<= [=(,*]) - 0\b", " 0", " ".join(line)).split() for line in lines if line]


class _Plain(ast.NodeTransformer):
    """Numbers as 0, negative ones too."""

    def visit_UnaryOp(self, node: ast.UnaryOp) -> ast.AST:
        inside = self.visit(node.operand)
        return inside if isinstance(inside, ast.Constant) else ast.UnaryOp(node.op, inside)

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        return ast.Constant(0) if isinstance(node.value, int | float) else node


def skeleton(text: str, lang: str) -> Any:
    """What an exported text is to whoever compiles it, numbers apart."""
    if lang == "json":
        return sorted(json.loads(text, parse_constant=pytest.fail))
    if lang == "python":
        return ast.dump(_Plain().visit(ast.parse(text)))
    return tokens(text, True), tokens(text, False)


def code_of(named: LoadedLaw, lang: str) -> tuple[str, str, str]:
    """What decides an exported code, numbers apart: one prefix serves laws of matched and of refracting surfaces."""
    return type(named.law).__name__, emit.prefix(named.law), lang


@cache
def expected() -> dict[tuple[str, str, str], Any]:
    """The same of the records unchanged."""
    found = {}
    for name in mutations.records():
        with tempfile.TemporaryDirectory() as folder:  # a folder of one record is read soonest
            shutil.copy(mutations.ROOT / "fits" / f"{name}.json", folder)
            with contextlib.suppress(RecordError):  # one of readings holds no law
                named = find(name, Path(folder))
                for lang in LANGUAGES:
                    found[code_of(named, lang)] = skeleton(export(named, Path(folder), lang), lang)
    return found


def export_faults(name: str, folder: Path, faults: list[str], told: str) -> None:
    """Export a record in every language, and compare what a compiler sees."""
    named = None
    with bounded(faults, f"{told}, find"):
        named = find(name, folder)
    known = expected()
    for lang in LANGUAGES if named else ():
        with bounded(faults, f"{told}, {lang}"):
            text = export(named, folder, lang)
            faults += [f"{told}, {lang}: control character {one!r}" for one in CONTROL.findall(text)[:1]]
            if skeleton(text, lang) != known.get(code_of(named, lang)):
                faults.append(f"{told}, {lang}: other code than of the record unchanged")


MARKS = ("short", "quality", "constants", "hazard", "readings", "inversion", "maps")


def table_faults(name: str, folder: Path, faults: list[str], told: str) -> None:
    """Print a record's tables, and fill those of a page in Markdown."""
    options: dict[str, Any] = dict.fromkeys(("figures_to", "markdown", "html", "evidence"))
    options |= {"quality": False, "claims": False, "fits": folder, "as_json": False, "quiet": True}
    for names in ([name], None):
        with bounded(faults, f"{told}, tables"), contextlib.redirect_stdout(io.StringIO()) as printed:
            report(names, **options)
            faults += [f"{told}, tables: control character {one!r}" for one in CONTROL.findall(printed.getvalue())[:1]]
    page = folder / "page.md"
    empty = "".join(f"<!-- {mark} -->\n<!-- /{mark} -->\n" for mark in MARKS)
    page.write_text(empty)
    with bounded(faults, f"{told}, markdown"):
        report([name], **options | {"markdown": page})
        text = page.read_text(encoding="utf-8")
        faults += [f"{told}, markdown: control character {one!r}" for one in CONTROL.findall(text)[:1]]
        if found := set(re.findall(r"(?<!\\)<[A-Za-z!/][^>]*", text)) - set(re.findall("<[^>]*", empty)):
            faults.append(f"{told}, markdown: markup {found}")
        if any(len({row.count("|") for row in rows}) > 1 for rows in _markdown_tables(text)):
            faults.append(f"{told}, markdown: rows of other lengths")


def _markdown_tables(text: str) -> Iterator[list[str]]:
    """The rows of each table, without bars that are escaped."""
    for part in re.split(r"\n(?!\|)", text):
        yield [row.replace("\\|", "") for row in part.split("\n") if row.startswith("|")]


VOID = {"br", "hr", "img", "input", "link", "meta", "path", "use", "line", "rect", "circle", "col"}


class Elements(HTMLParser):
    """The kinds of elements of a page, each its name with those of its attributes; and what stands in scripts."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.counts: Counter[tuple[str, ...]] = Counter()
        self.open, self.scripts, self.addresses, self.misnested = list[str](), list[str](), set[str](), list[str]()
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.counts[tag, *sorted(name for name, _ in attrs)] += 1
        self.addresses |= {str(value)[:11] for name, value in attrs if name in ("href", "src")}
        if tag not in VOID:
            self.open.append(tag)
        if tag == "script":
            self.scripts.append("")

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        self.open = self.open[:-1] if tag not in VOID else self.open

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID and (not self.open or self.open.pop() != tag):
            self.misnested.append(tag)

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] == "script":
            self.scripts[-1] += data

    @property
    def active(self) -> Counter[tuple[str, ...]]:
        """Those that do something, of which a record brings no more."""
        doing = {"script", "style", "link", "meta", "iframe", "object", "embed", "base", "form", "button", "input"}
        return Counter({kind: count for kind, count in self.counts.items() if kind[0] in doing})


def page(name: str, folder: Path) -> str:
    """The report of a folder's one record as a page."""
    write_page(folder / "page.html", folder, folder / "evidence", [name])
    return (folder / "page.html").read_text(encoding="utf-8")


@cache
def unchanged_page(name: str) -> Elements:
    with tempfile.TemporaryDirectory() as folder:
        for ending in (".json", ".npz"):
            shutil.copy(mutations.ROOT / "fits" / f"{name}{ending}", folder)
        return Elements(page(name, Path(folder)))


def page_faults(name: str, folder: Path, faults: list[str], told: str) -> bool:
    """Make the page of a mutated record, and compare its elements with those of the record unchanged; True if made."""
    known, text = unchanged_page(name), ""
    try:
        text = page(name, folder)
    except NAMED as error:
        faults += [f"{told}: {str(error)[:300]!r}"] if len(str(error).splitlines()) != 1 else []
        return False
    except Exception as error:
        faults.append(f"{told}: {type(error).__name__}: {str(error)[:200]} at {_place(error)}")
        return False
    found = Elements(text)
    data = [one for one in found.scripts if one.lstrip().startswith("{")]
    for one in data:
        json.loads(one, parse_constant=pytest.fail)
    wrong: dict[str, object] = {
        "elements": set(found.counts) - set(known.counts),
        "more scripts or controls": found.active - known.active,  # fewer, where a fit that failed has no figures
        "elements that do not close": found.misnested + found.open,
        "addresses": {one for one in found.addresses - known.addresses if not one.startswith("#")},
        "the explorer's data must be one piece of JSON without <": len(data) != 1 or "<" in data[0],
        "control characters": CONTROL.findall(text)[:5],
    }
    faults += [f"{told}: {what} {seen}" for what, seen in wrong.items() if seen]
    return True


def _place(error: BaseException) -> str:
    """Where an error was raised, and through which of our files."""
    frames = [one for one in traceback.extract_tb(error.__traceback__) if "site-packages" not in one.filename]
    return " < ".join(f"{Path(one.filename).name}:{one.lineno}" for one in reversed(frames[-3:]))


def copied(seed: int, folder: Path) -> str | None:
    """The name of a mutated record, now the only one in `folder`, if it is accepted."""
    name, data = mutations.record(seed)
    for path in folder.glob("*.json"):
        path.unlink()
    (folder / f"{name}.json").write_bytes(data)
    try:
        record.read(folder / f"{name}.json", whole=True)
    except NAMED:
        return None
    return name


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("count", [QUICK, *slow(ALL)], ids=["quick", "many"])
def test_reading_refuses_or_takes_data(count, kind, elsewhere):
    ending, mutant, readers = KINDS[kind]
    path, faults, accepted = elsewhere / f"one{ending}", list[str](), 0
    for seed in range(count):
        path.write_bytes(mutant(seed))
        taken = 0
        for read in readers:
            with bounded(faults, f"{kind} {seed}"):
                read(path)
                taken += 1
        accepted += taken == len(readers)
    require_none(faults)
    assert count / 40 < accepted < count  # neither all nor none, or nothing was tried


@pytest.mark.slow
@pytest.mark.parametrize("part", range(4))
def test_exports_and_tables_of_many(part, elsewhere):
    faults, accepted = list[str](), 0
    for seed in range(part, ALL, 4):
        if name := copied(seed, elsewhere):
            accepted += 1
            export_faults(name, elsewhere, faults, f"record {seed}")
            table_faults(name, elsewhere, faults, f"record {seed}")
    require_none(faults)
    assert accepted > ALL / 40


@pytest.mark.slow
@pytest.mark.parametrize("part", range(5))
def test_pages_of_fifty(part, elsewhere):
    """Of the records whose figures are soonest drawn; the arrays of every third are mutated, too."""
    soon = {"albedo-rational", "albedo-liang", "albedo-rational-diffuse-refracting", "gaussians-2", "burley-whole"}
    faults, made, seeds = list[str](), 0, itertools.count(ALL + part, 5)
    while made < 10:
        seed = next(seeds)
        name = copied(seed, elsewhere)
        if name not in soon:
            continue
        shutil.copy(mutations.ROOT / "fits" / f"{name}.npz", elsewhere)
        if seed % 3 == 0 and name == "albedo-rational":
            (elsewhere / f"{name}.npz").write_bytes(SAMPLES(seed))
        made += page_faults(name, elsewhere, faults, f"record {seed}")
    require_none(faults)


def test_checks_see_what_they_look_for():
    """Negative controls: what an injected line makes of each text."""
    glsl = "// one\nconst float a = 1.0;\n"
    assert tokens(glsl, True) == tokens("// two\nconst float a = -2e-3;\n", True)
    assert tokens("// one\nfloat b; //\nconst float a = 1.0;\n", True) != tokens(glsl, True)
    assert tokens("// one\\\nconst float a = 1.0;\n", True) != tokens(glsl, True)
    assert skeleton("# one\na = 1.0\n", "python") == skeleton("# two\na = -2.0\n", "python")
    assert skeleton("# one\nimport os\na = 1.0\n", "python") != skeleton("# one\na = 1.0\n", "python")
    plain, evil = Elements("<p>one</p>"), Elements("<p onclick='x'>one</p><script>x</script><b>")
    assert set(evil.counts) - set(plain.counts) == {("p", "onclick"), ("script",), ("b",)}
    assert evil.open == ["b"]


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


def _faults_of(kind: str, seeds: Sequence[int], folder: Path) -> list[str]:
    """Run a command on mutated files, each in a folder of its own."""
    module, arguments, _ = AS_PROCESSES[kind]
    ending, mutant, _ = KINDS["record" if kind in ("export", "report") else kind]
    faults: list[str] = []
    folder.mkdir()
    with processes.commands(folder) as run:
        for seed in seeds:
            here = folder / str(seed)
            here.mkdir()
            name = mutations.record(seed)[0] if ending == ".json" else "one"
            (here / f"{name}{ending}").write_bytes(mutant(seed))
            told = [{"NAME": name, "FILE": f"{name}{ending}"}.get(word, word) for word in arguments]
            ended = run(module, told, here)
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
        taken = False
        with contextlib.suppress(*NAMED):
            for read in readers:
                read(path)
            taken = True
        if not taken or answered > 0:
            answered -= taken
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
    """A few side by side."""
    seeds = list(_seeds(kind, PROCESSES, elsewhere))
    with ThreadPoolExecutor(BESIDE) as pool:
        found = pool.map(lambda part: _faults_of(kind, seeds[part::BESIDE], elsewhere / f"part{part}"), range(BESIDE))
        require_none([fault for faults in found for fault in faults])
