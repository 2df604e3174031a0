"""Imports point one way: down the lists below, and never from the simulator to the fits."""

import ast
import graphlib
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

# A file, or a folder taken as one, imports only from those before it. A new one needs its place here.
ORDER = {
    "mcml_sim": (
        "errors",
        "version",
        "lazy",
        "plain",
        "whole_file",
        "text_file",
        "npz",
        "checks",
        "medium",
        "setting",
        "optics",
        "phase",
        "grid",
        "bins",
        "rng",
        "isotropic",
        "photon",
        "white",
        "single",
        "order_bins",
        "tally",
        "deposits",
        "store",
        "pool",
        "tracer",
        "layered",
        "matched",
        "cluster",
        "progress",
        "run",
        "orders",
        "quantities",
        "simulation",
        "complex_functions",
        "bessel",
        "dispersion",
        "half_space_transform",
        "hankel",
        "by_albedo",
        "exact",
        "mci",
        "mco",
        "mco_reader",
        "mcml_files",
        "results",
        "compiling",
        "printed",
        "letters",
        "terminal",
        "screen",
        "help",
        "program",
        "__init__",
        "command",
        "cli",
        "__main__",
    ),
    "profilefit": (
        "errors",
        "profiles",
        "laws",
        "samplers",
        "trimming",
        "quality",
        "sampling",
        "convert",
        "objectives",
        "solver",
        "estimate",
        "walking",
        "chains",
        "replicates",
        "bootstrap",
        "discrepancy",
        "discretisation",
        "coverage",
        "derived",
        "staged",
        "schema",
        "recipe",
        "targets",
        "record",
        "folder",
        "catalogue",
        "inventory",
        "truth",
        "materials",
        "protocol",
        "reproduction",
        "table1",
        "run",
        "starts",
        "crosscheck",
        "quality_tally",
        "described",
        "pipelines",
        "calibrate",
        "measured",
        "evidence",
        "shader",
        "tradeoff",
        "stability",
        "choose",
        "report",
        "__init__",
        "commands",
        "cli",
        "__main__",
    ),
    "profilefit.shader": (
        "glsl",
        "languages",
        "emit",
        "export",
        "context",
        "check",
        "stage",
        "truth",
        "__init__",
    ),
    "profilefit.shader.check": (
        "evaluate",
        "validity",
        "bounds",
        "grid",
        "verdict",
        "claims",
        "twin",
        "laws",
        "maps",
        "chosen",
        "half",
        "cost",
        "__init__",
    ),
    "profilefit.shader.stage": (
        "lattice",
        "blue_noise",
        "sampling",
        "material",
        "camera",
        "mesh",
        "head",
        "skin_texture",
        "scene",
        "buffers",
        "full_screen",
        "exact_law",
        "targets",
        "separable_kernel",
        "scattering",
        "combining",
        "geometry",
        "stage",
        "coverage",
        "__init__",
    ),
    "profilefit.shader.truth": (
        "step_edge",
        "edge_estimate",
        "exact_table",
        "surface",
        "reference",
        "__init__",
    ),
    "profilefit.measured": (
        "lengths",
        "data",
        "limits",
        "replicates",
        "table_file",
        "simulated",
        "reading",
        "noise",
        "model",
        "question",
        "solving",
        "derived",
        "law_error",
        "misfit",
        "fitting",
        "telling",
        "candidates",
        "chain",
        "answer",
        "asking",
        "__init__",
    ),
    "profilefit.tradeoff": (
        "stopwatch",
        "machine",
        "points",
        "written",
        "scalar",
        "truth",
        "counting",
        "contenders",
        "tabulated",
        "laws",
        "samplers",
        "fits",
        "parts",
        "__init__",
    ),
    "profilefit.choose": (
        "case",
        "response",
        "truth",
        "gather",
        "gaussian_filter",
        "options",
        "filtered",
        "error",
        "cost",
        "scene",
        "layers",
        "choice",
        "__init__",
    ),
    "profilefit.laws": (
        "evaluate",
        "base",
        "rational",
        "decay",
        "escape",
        "hazard_curve",
        "hazard",
        "liang_albedo",
        "liang",
        "burley",
        "van_de_hulst",
        "chiang",
        "diffusion",
        "dipole",
        "better_dipole",
        "beam_diffusion",
        "gaussians",
        "skin_gaussians",
        "quantile",
        "published",
        "__init__",
    ),
    "profilefit.stability": (
        "classes",
        "axes",
        "layout",
        "cells",
        "arithmetic",
        "reference",
        "laws",
        "model",
        "maps",
        "halfspace",
        "conversions",
        "misuse",
        "gradients",
        "fits",
        "cause",
        "stated",
        "causes_of_liang",
        "causes_of_models",
        "causes_of_format",
        "causes",
        "regions",
        "atlas",
        "__init__",
    ),
    "profilefit.report": (
        "digits",
        "content",
        "columns",
        "spark",
        "source",
        "canvas",
        "labels",
        "albedo_figure",
        "coefficient_figures",
        "profile_figures",
        "inverse_figure",
        "inversion_figure",
        "quality_figure",
        "residual_figure",
        "constants_figure",
        "quality_tables",
        "sampler_tables",
        "evidence_tables",
        "summary_tables",
        "corner_figure",
        "fit_figures",
        "fit_tables",
        "figures",
        "markdown",
        "law_page",
        "check_tables",
        "tradeoff_figure",
        "tradeoff_tables",
        "choose_table",
        "all_laws",
        "stability_figure",
        "stability_tables",
        "law_tables",
        "tables",
        "explorer",
        "page",
        "__init__",
    ),
    "profilefit.report.page": (
        "markup",
        "vector",
        "lettering",
        "drawings",
        "measured",
        "failures",
        "speed",
        "shader",
        "provenance",
        "fits",
        "document",
        "__init__",
    ),
    "profilefit.report.explorer": (
        "truth",
        "laws",
        "still",
        "fragment",
        "__init__",
    ),
}

# Packages that a function may import where it needs them, because not every installation has them.
OPTIONAL = frozenset({"dask", "distributed", "numba", "arviz_base"})

Imports = dict[str, set[str]]


def modules(root: Path, package: str) -> dict[str, Path]:
    """Dotted name -> file; a folder goes by its own name."""
    paths = sorted((root / package).rglob("*.py"))
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


def import_graph(root: Path, package: str) -> Imports:
    """Module -> the modules of the same package that it names, each the deepest that exists."""
    files = modules(root, package)

    def deepest(name: str) -> str | None:
        while name and name not in files:
            name = name.rpartition(".")[0]
        return name or None

    graph: Imports = {}
    for module, path in files.items():
        tree = ast.parse(path.read_text(encoding="utf-8"))
        targets = {deepest(name) for name in imported_names(tree, module, path.name == "__init__.py")}
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
    """The entry of ORDER[package] that a module under it belongs to."""
    return module.removeprefix(package).lstrip(".").split(".")[0] or "__init__"


def upward(graph: Imports, package: str, order: tuple[str, ...]) -> list[str]:
    """The imports inside a package that point against its order."""
    inside = {module for module in graph if module == package or module.startswith(f"{package}.")}
    edges = [(module, target) for module in sorted(inside) for target in sorted(graph[module] & inside)]
    ends = [(order.index(part(package, module)), order.index(part(package, target))) for module, target in edges]
    return [f"{edge[0]} imports {edge[1]}" for edge, end in zip(edges, ends, strict=True) if end[1] > end[0]]


def inner_imports(path: Path) -> list[str]:
    """Imports inside functions of anything that is not optional, as file:line."""
    functions = (ast.FunctionDef, ast.AsyncFunctionDef)
    outer = [node for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, functions)]
    nodes = {node for function in outer for node in ast.walk(function) if isinstance(node, ast.Import | ast.ImportFrom)}
    return [
        f"{path}:{node.lineno}"
        for node in sorted(nodes, key=lambda node: node.lineno)
        if not {name.split(".")[0] for name in imported_names(node, "", False)} <= OPTIONAL
    ]


def test_simulator_knows_nothing_of_the_fits():
    for module, path in modules(ROOT, "mcml_sim").items():
        names = imported_names(ast.parse(path.read_text(encoding="utf-8")), module, path.name == "__init__.py")
        assert not [name for name in names if name.split(".")[0] == "profilefit"], path


@pytest.mark.parametrize("package", ["mcml_sim", "profilefit"])
def test_no_import_cycle(package):
    assert cycle(import_graph(ROOT, package)) == []


@pytest.mark.parametrize("package", ["mcml_sim", "profilefit"])
def test_no_import_inside_a_function(package):
    assert [place for path in modules(ROOT, package).values() for place in inner_imports(path)] == []


@pytest.mark.parametrize("package", ORDER)
def test_imports_follow_the_order(package):
    order = ORDER[package]
    graph = import_graph(ROOT, package.split(".")[0])
    parts = {part(package, module) for module in graph if module == package or module.startswith(f"{package}.")}
    assert parts <= set(order), f"give each new file of {package} its place in ORDER"
    assert upward(graph, package, order) == []


def test_checks_see_what_they_look_for(tmp_path):
    """Negative control: one small package that breaks every rule."""
    package = tmp_path / "bad"
    (package / "sub").mkdir(parents=True)
    (package / "__init__.py").write_text("from .first import f\n")
    (package / "first.py").write_text("from bad import second\n")
    (package / "second.py").write_text("from .first import f\n")
    (package / "sub" / "__init__.py").write_text("from ..second import g\n")
    (package / "sub" / "leaf.py").write_text("def f():\n    import json\n")

    graph = import_graph(tmp_path, "bad")
    assert graph == {
        "bad": {"bad.first"},
        "bad.first": {"bad.second"},
        "bad.second": {"bad.first"},
        "bad.sub": {"bad.second"},
        "bad.sub.leaf": set(),
    }
    assert set(cycle(graph)) == {"bad.first", "bad.second"}
    assert upward(graph, "bad", ("first", "sub", "second", "__init__")) == [
        "bad.first imports bad.second",
        "bad.sub imports bad.second",
    ]
    assert inner_imports(package / "sub" / "leaf.py") == [f"{package / 'sub' / 'leaf.py'}:2"]
