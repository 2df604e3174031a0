"""Rooms: imports point one way, down the lists below, and never from the simulator to the fits."""

import ast
import graphlib
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path

import pytest

from profilefit.recipes.kinds import KINDS

ROOT = Path(__file__).resolve().parents[2]

# A room, or a file in the root, imports only from those before it.
ROOMS = {
    "mcml_sim": ["errors", "files", "media", "exact", "tracing", "results", "runs", "cli", "__init__", "__main__"],
    "profilefit": [
        *("errors", "laws", "materials", "convert", "fitting", "recipes", "measured", "shader"),
        *("scenes", "studies", "report", "__init__", "cli", "__main__"),
    ],
    "profilefit.scenes": ["stage", "skin", "layers", "heart", "sea", "fur", "__init__"],
}

PACKAGES = ("mcml_sim", "profilefit")

# Packages that a function may import where it needs them, because not every installation has them.
OPTIONAL = frozenset({"dask", "distributed", "numba", "arviz_base"})

Imports = dict[str, set[str]]
SHORT, LONG = 60, 600  # lines: a shorter file needs a second importer, a longer one is two nouns
# One public name in either package: what `exact.solve` and `fitting.least_squares` return.
SHARED_NAMES = {"Solution"}


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def modules(root: Path, *packages: str) -> dict[str, Path]:
    """Dotted name -> file; a folder goes by its own name."""
    paths = [path for package in packages for path in sorted((root / package).rglob("*.py"))]
    return {".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__"): path for path in paths}


def imported_names(tree: ast.AST, module: str, is_package: bool) -> Iterator[str]:
    """Absolute dotted names; `from a import b` gives a.b, whether b is a module or not."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parts = module.split(".")
            here = parts[: len(parts) + is_package - node.level] if node.level else []
            base = ".".join([*here, *([node.module] if node.module else [])])
            yield from (f"{base}.{alias.name}" for alias in node.names)


def names_in(path: Path, module: str) -> set[str]:
    return set(imported_names(parsed(path), module, path.name == "__init__.py"))


@cache
def import_graph(root: Path, *packages: str) -> Imports:
    """Module -> the modules of these packages that it names, each the deepest that exists."""
    files = modules(root, *packages)

    def deepest(name: str) -> str | None:
        while name and name not in files:
            name = name.rpartition(".")[0]
        return name or None

    graph: Imports = {}
    for module, path in files.items():
        targets = {deepest(name) for name in names_in(path, module)}
        graph[module] = {target for target in targets if target} - {module}
    return graph


def cycle(graph: Imports) -> list[str]:
    """The modules of one import cycle, or none."""
    try:
        graphlib.TopologicalSorter(graph).prepare()
    except graphlib.CycleError as error:
        return error.args[1]
    return []


def part(package: str, module: str) -> str:
    """The room, or the file in the root, that a module belongs to."""
    return module.removeprefix(package).lstrip(".").split(".")[0] or "__init__"


def upward(graph: Imports, package: str, order: Sequence[str]) -> list[str]:
    """The imports inside a package that point against its order."""
    place = {module: order.index(part(package, module)) for module in graph if f"{module}.".startswith(f"{package}.")}
    edges = [(module, target) for module in sorted(place) for target in sorted(graph[module] & place.keys())]
    return [f"{module} imports {target}" for module, target in edges if place[target] > place[module]]


def inner_imports(path: Path) -> list[str]:
    """Imports inside functions of what is not optional, as file:line."""
    functions = [node for node in ast.walk(parsed(path)) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]
    nodes = {one for node in functions for one in ast.walk(node) if isinstance(one, ast.Import | ast.ImportFrom)}
    return [
        f"{path}:{node.lineno}"
        for node in sorted(nodes, key=lambda node: node.lineno)
        if not {name.split(".")[0] for name in imported_names(node, "", False)} <= OPTIONAL
    ]


def test_simulator_knows_nothing_of_the_fits():
    for module, path in modules(ROOT, "mcml_sim").items():
        assert not [name for name in names_in(path, module) if name.split(".")[0] == "profilefit"], path


@pytest.mark.parametrize("package", PACKAGES)
def test_no_import_cycle(package):
    assert cycle(import_graph(ROOT, package)) == []


@pytest.mark.parametrize("package", PACKAGES)
def test_no_import_inside_a_function(package):
    """A command imports what takes long in its body: help and completion need none of it."""
    files = [path for path in modules(ROOT, package).values() if path.parent.name != "cli"]
    assert [place for path in files for place in inner_imports(path)] == []


@pytest.mark.parametrize("package", ROOMS)
def test_imports_go_down_the_rooms(package):
    whole = import_graph(ROOT, package.partition(".")[0])
    graph = {module: whole[module] for module in whole if f"{module}.".startswith(f"{package}.")}
    assert {part(package, module) for module in graph} == set(ROOMS[package])
    assert upward(graph, package, ROOMS[package]) == []


def test_no_scene_knows_another():
    room = "profilefit.scenes"
    for module, targets in import_graph(ROOT, "profilefit").items():
        if module.startswith(f"{room}.") and (own := part(room, module)) != "stage":
            assert {part(room, target) for target in targets if target.startswith(f"{room}.")} <= {"stage", own}, module


# Rooms of a kind, whose modules commands reach by the table of kinds. `fit` takes tables of one's own, by name.
OF_KINDS = ("recipes.stack", "recipes.phases", "shader.stack_text", "shader.phase_text")
OF_OWN_DATA = ("fit", "fit_layers")


def known_kinds(path: Path) -> list[str]:
    """Imports of what only one kind has, and comparisons with the name of a kind, in a command, as file:line."""
    found = set()
    words = {word for kind in KINDS for word in (kind.key, kind.folder, kind.plural)} - {""}
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Import | ast.ImportFrom):
            homes = [name.removeprefix("profilefit.") for name in imported_names(node, "profilefit.cli.x", False)]
            own = {f"recipes.kinds.{kind.key}" for kind in KINDS}
            if any(f"{home}.".startswith(f"{one}.") for home in homes for one in {*OF_KINDS, *own}):
                found.add(node.lineno)
        elif isinstance(node, ast.Compare | ast.Match | ast.Subscript):
            told = {one.value for one in ast.walk(node) if isinstance(one, ast.Constant)}
            if told & words:
                found.add(node.lineno)
    return [f"{path}:{line}" for line in sorted(found)]


def test_commands_know_no_kind_by_name():
    commands = [path for path in (ROOT / "profilefit" / "cli").glob("*.py") if path.stem not in OF_OWN_DATA]
    assert len(commands) > 10
    assert [place for path in commands for place in known_kinds(path)] == []


def test_a_file_is_one_noun():
    """Neither a crumb of one other file nor two; commands, kinds and a scene's names are a file each, however short."""
    importers = Counter(home for targets in import_graph(ROOT, *PACKAGES).values() for home in targets)
    wrong = set()
    for module, path in modules(ROOT, *PACKAGES).items():
        lines = len(path.read_text(encoding="utf-8").splitlines())
        of_scene = ".scenes." in module and path.stem in FIVE_NAMES
        if path.stem in ("__init__", "__main__") or of_scene or ".cli." in module or ".recipes.kinds." in module:
            continue
        if lines > LONG or (lines < SHORT and importers[module] < 2):
            wrong.add(module)
    assert wrong == set()


def class_homes(root: Path, packages: Sequence[str]) -> dict[str, list[str]]:
    """Class name -> the modules that define one."""
    found: dict[str, list[str]] = {}
    for module, path in modules(root, *packages).items():
        for node in ast.walk(parsed(path)):
            if isinstance(node, ast.ClassDef):
                found.setdefault(node.name, []).append(module)
    return found


def test_no_two_classes_have_one_name():
    assert {name for name, modules in class_homes(ROOT, PACKAGES).items() if len(modules) > 1} == SHARED_NAMES


def written(folder: Path, texts: dict[str, str]) -> None:
    """Write modules into a new folder."""
    folder.mkdir()
    for name, text in texts.items():
        (folder / f"{name}.py").write_text(text)


def test_checks_see_what_they_look_for(tmp_path):
    """Negative control: one small package that breaks every rule."""
    texts = {
        "__init__": "from .first import f\n",
        "first": "from bad import second\nclass Grid: ...\n",
        "second": "from .first import f\nclass Grid: ...\n",
    }
    written(tmp_path / "bad", texts)
    written(tmp_path / "bad" / "sub", {"__init__": "from ..second import g\n", "leaf": "def f():\n    import json\n"})
    graph, leaf = import_graph(tmp_path, "bad"), tmp_path / "bad" / "sub" / "leaf.py"
    ring = {"bad": {"bad.first"}, "bad.first": {"bad.second"}, "bad.second": {"bad.first"}}
    assert graph == {**ring, "bad.sub": {"bad.second"}, "bad.sub.leaf": set()}
    assert set(cycle(graph)) == {"bad.first", "bad.second"}
    against = upward(graph, "bad", ("first", "sub", "second", "__init__"))
    assert against == ["bad.first imports bad.second", "bad.sub imports bad.second"]
    assert class_homes(tmp_path, ["bad"]) == {"Grid": ["bad.first", "bad.second"]}
    assert inner_imports(leaf) == [f"{leaf}:2"]


# Beginnings that say nothing without a neighbour.
ELLIPTICAL = re.compile(r"(What|Of|That|The same|Where|By|How|Those|As|Which|Who|Its|Their|Them|They|It)\b")


def elliptical(path: Path) -> list[str]:
    """Return file:line of docstrings, those of attributes included, that begin with an elliptical phrase."""
    return [
        f"{path}:{node.lineno}"
        for node in ast.walk(parsed(path))
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        if ELLIPTICAL.match(node.value.value)
    ]


# One machine each: the only modules that may import a library, and all that may be imported of scipy's optimisers:
# a root in an interval, and least squares of weights >= 0. Benchmarks have pools of processes of their own.
HOMES = {
    "optimistix": "profilefit.fitting.solver",
    "emcee": "profilefit.fitting.chains",
    "multiprocessing": "profilefit.recipes.workers",
    "concurrent.futures.process": "profilefit.recipes.workers",
    "concurrent.futures.ProcessPoolExecutor": "profilefit.recipes.workers",
}
SOLVED_BY_SCIPY = {"scipy.optimize.brentq", "scipy.optimize.nnls"}


def imports_of(root: Path, packages: Sequence[str], library: str) -> dict[str, set[str]]:
    """Module -> what it imports of a library, by dotted names."""
    inside = f"{library}."
    each = {
        module: {name for name in names_in(path, module) if f"{name}.".startswith(inside)}
        for module, path in modules(root, *packages).items()
    }
    return {module: names for module, names in each.items() if names}


@pytest.mark.parametrize("library", HOMES)
def test_a_library_has_one_home(library):
    assert set(imports_of(ROOT, PACKAGES, library)) == {HOMES[library]}


# How a file is read is the machine of `declared`; others only annotate the fields of their models.
DECLARED = "profilefit.recipes.declared"
FIELDS = {
    *("Field", "PrivateAttr", "ConfigDict", "Discriminator", "Tag", "ValidationInfo", "WithJsonSchema"),
    *("AfterValidator", "BeforeValidator", "model_validator", "json_schema.models_json_schema"),
}


def test_files_are_declared_in_one_way():
    homes = imports_of(ROOT, PACKAGES, "pydantic")
    machine = homes.pop(DECLARED)
    assert {"pydantic.BaseModel", "pydantic.ValidationError"} <= machine
    assert {name.removeprefix("pydantic.") for names in homes.values() for name in names} == FIELDS
    assert set(imports_of(ROOT, PACKAGES, "pydantic_core")) == {DECLARED}
    assert set(imports_of(ROOT, PACKAGES, "tomllib")) == {"mcml_sim.files.whole_file"}


def test_scipy_minimises_nothing():
    names = set().union(*imports_of(ROOT, PACKAGES, "scipy.optimize").values())
    assert names == SOLVED_BY_SCIPY, "what is fitted is fitted by fitting.solver"


def test_second_homes_are_seen(tmp_path):
    """Negative control: two modules with a sampler and a minimiser of their own, one under another name."""
    texts = {
        "walks": "from emcee.moves import DEMove\nimport emceeish\nfrom concurrent.futures import ThreadPoolExecutor\n",
        "fits": "def f():\n    from scipy import optimize as o\n    import emcee as e\n",
        "pools": "from concurrent.futures import ProcessPoolExecutor\nimport multiprocessing.pool\n"
        "import multiprocessing as m\n",
    }
    written(tmp_path / "bad", texts)
    assert imports_of(tmp_path, ["bad"], "emcee") == {"bad.fits": {"emcee"}, "bad.walks": {"emcee.moves.DEMove"}}
    assert imports_of(tmp_path, ["bad"], "scipy.optimize") == {"bad.fits": {"scipy.optimize"}}
    for library in ("concurrent.futures.ProcessPoolExecutor", "multiprocessing"):
        assert set(imports_of(tmp_path, ["bad"], library)) == {"bad.pools"}


# A scene is a folder with these files, its GLSL beside them, and the physics they need, a noun a file.
FIVE_NAMES = {"law", "truth", "passes", "scene", "chart"}
SCENES = ("skin", "layers", "heart", "sea", "fur")
RENDERER, TIMER = "profilefit/scenes/stage/renderer.py", "profilefit/shader/context.py"
# Objects of a context, that only a renderer makes; and Python's clocks.
OF_A_CONTEXT = {
    *("texture", "framebuffer", "simple_framebuffer", "depth_renderbuffer", "renderbuffer", "buffer"),
    *("program", "vertex_array", "simple_vertex_array", "scope", "compute_shader", "sampler"),
}
CLOCKS = {"time", "timeit", "datetime"}


def missing_names(folder: Path) -> set[str]:
    """Names of a scene's five files that its folder lacks."""
    return FIVE_NAMES - {path.stem for path in folder.glob("*.py")}


def renders(path: Path) -> set[str]:
    """What a file has of a renderer or a timer of its own: calls on a context, clocks, queries of OpenGL."""
    found = set()
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Import | ast.ImportFrom):
            found |= {name.split(".")[0] for name in imported_names(node, "", False)} & CLOCKS
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            found |= {node.func.attr} & OF_A_CONTEXT
            if node.func.attr == "query" and {key.arg for key in node.keywords} & {"time", "samples", "primitives"}:
                found.add("query")
    return found


@pytest.mark.parametrize("name", [*(f"profilefit/scenes/{one}" for one in SCENES), "tests/unit/scenes/toy"])
def test_a_scene_has_its_five_names_and_no_renderer(name):
    folder = ROOT / name
    assert missing_names(folder) == set()
    assert {path.name: own for path in folder.rglob("*.py") if (own := renders(path))} == {}


def nouns(folder: Path) -> list[str]:
    """Files and sub-rooms of a room."""
    files = [path.stem for path in folder.glob("*.py") if path.stem != "__init__"]
    return sorted([*files, *(path.parent.name for path in folder.glob("*/__init__.py"))])


def test_a_room_of_scenes_has_3_to_12_nouns(tmp_path):
    rooms = [path.parent for path in (ROOT / "profilefit" / "scenes").rglob("__init__.py")]
    assert len(rooms) > 8
    assert {room: len(nouns(room)) for room in rooms if not 3 <= len(nouns(room)) <= 12} == {}
    written(tmp_path / "bad", dict.fromkeys(["__init__", "first"], ""))  # negative control
    written(tmp_path / "bad" / "inner", dict.fromkeys(["__init__", "second"], ""))
    assert nouns(tmp_path / "bad") == ["first", "inner"]


def test_every_scene_is_one_of_the_shelf():
    rooms = {path.parent.name for path in (ROOT / "profilefit" / "scenes").glob("*/__init__.py")}
    assert rooms == {"stage", *SCENES}


def test_one_renderer_and_one_timer_of_the_gpu():
    """Only the renderer has objects of a context on the stage; queries of OpenGL stand in one file of the package."""
    stage = {path for path in (ROOT / "profilefit" / "scenes" / "stage").rglob("*.py") if renders(path)}
    assert stage == {ROOT / RENDERER}
    package = [path for path in (ROOT / "profilefit").rglob("*.py") if "query" in renders(path)]
    assert package == [ROOT / TIMER]
    assert not renders(ROOT / RENDERER) & CLOCKS


def test_a_scene_with_a_renderer_of_its_own_is_seen(tmp_path):
    """Negative control: a folder that lacks names, and files that draw and time by themselves."""
    seen = {
        "def f(tree, x): return tree.query(x, 2)\n": set(),
        "def f(context): return context.framebuffer([])\n": {"framebuffer"},
        "from time import perf_counter\n": {"time"},
        "def f(context): return context.query(time=True)\n": {"query"},
        "import time\ndef f(stage): return stage.time(), stage.context.texture((1, 1), 4)\n": {"time", "texture"},
    }
    names = dict(zip(("law", *"abcd"), seen, strict=True))
    written(tmp_path / "bad", names)
    assert missing_names(tmp_path / "bad") == FIVE_NAMES - {"law"}
    assert {text: renders(tmp_path / "bad" / f"{name}.py") for name, text in names.items()} == seen


# Words that name nothing: a public function, class, argument or attribute says what it is.
NAMELESS = frozenset(
    "found one made told taken again alike off lit begun wanted need".split()  # noqa: SIM905 - as it is read
)


def nameless(path: Path) -> list[str]:
    """Return file:line of public functions, their arguments, classes and their attributes that have such a name."""
    found = []
    for node in ast.walk(parsed(path)):
        names: list[str] = []
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
            names.append(node.name)
            if isinstance(node, ast.FunctionDef):
                names += [each.arg for each in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]
            else:
                names += [each.target.id for each in node.body if isinstance(each, ast.AnnAssign)]
        found += [f"{path}:{node.lineno}" for name in names if name.lower() in NAMELESS]
    return found


@pytest.mark.parametrize(
    ("wrong", "place"),
    [*((elliptical, place) for place in (*PACKAGES, "benchmarks")), *((nameless, place) for place in PACKAGES)],
)
def test_a_docstring_can_be_read_alone_and_public_names_say_what_they_are(wrong, place):
    assert (paths := sorted((ROOT / place).rglob("*.py")))
    assert [line for path in paths for line in wrong(path)] == []


@pytest.mark.parametrize(
    ("wrong", "lines", "text"),
    [
        (  # imports of a kind, and its name; none of the first two lines
            *(known_kinds, [3, 4, 5, 6, 7, 8, 10]),
            'from profilefit.recipes.kinds import KINDS\nif name == "hazard": pass\n'
            "from profilefit.recipes.kinds.stack import load\nfrom profilefit.recipes.kinds import gaussians\n"
            'import profilefit.recipes.phases.data\nif kind.key == "phase": pass\nif where in ("stacks", "x"): pass\n'
            'match kind.key:\n    case "albedo_map": pass\ntext = SOURCES["law"]\n',
        ),
        (  # a module, a class and an attribute; a function's "Offer" is fine
            *(elliptical, [1, 3, 5]),
            '"""What."""\nclass A:\n    """Of B."""\n    a: int\n    """By b."""\ndef f():\n    """Offer."""\n',
        ),
        (  # a function, an argument, a class and an attribute; private ones may
            *(nameless, [1, 2, 3, 3]),
            "def found(): ...\ndef f(one): ...\nclass Made:\n    told: int\ndef _g(off): ...\nclass Offer: ...\n",
        ),
    ],
    ids=["known_kinds", "elliptical", "nameless"],
)
def test_a_wrong_line_is_seen(tmp_path, wrong, lines, text):
    """Negative control."""
    path = tmp_path / "bad.py"
    path.write_text(text)
    assert sorted(wrong(path)) == sorted(f"{path}:{line}" for line in lines)
