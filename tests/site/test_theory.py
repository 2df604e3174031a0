"""docs/theory/exact.md: its formulas as they stand there, by brute force, against each other and against the code."""

import re
from pathlib import Path

import numpy as np
import pytest
from docutils.utils.math.latex2mathml import tex2mathml
from scipy.integrate import quad
from scipy.special import j0

from mcml_sim import Setting, exact

PAGE = Path(__file__).resolve().parents[2] / "docs" / "theory" / "exact.md"
TINY = {"epsabs": 1e-12, "epsrel": 1e-10, "limit": 400}


def s_of(m, k):
    return np.sqrt(1.0 / m**2 + k**2)


def over_m(f):
    return quad(f, 0.0, 1.0, **TINY)[0]


def h_function(nu, alpha, k):
    """(14) with x = tan(t) / nu."""

    def log_dispersion(t):
        big = np.hypot(k, np.tan(t) / nu)
        return np.log(1.0 - alpha * (np.arctan(big) / big if big > 0 else 1.0))

    return np.exp(-quad(log_dispersion, 0.0, np.pi / 2, **TINY)[0] / np.pi)


def transform_of_formula(alpha, k, illumination, nodes=24):
    """(16) or (17) with H of (14); Gauss nodes in the root of m, which suits the m ln m of H."""
    t, w = np.polynomial.legendre.leggauss(nodes)
    m, dm = (0.5 * (t + 1.0)) ** 2, 0.5 * (t + 1.0) * w
    s = s_of(m, k)
    h = dm * [h_function(1.0 / each, alpha, k) for each in s]
    if illumination == "searchlight":
        return 0.5 * alpha * h_function(1.0, alpha, k) * np.sum(h / (1.0 + s))
    return alpha * np.sum(h[:, None] * h / (s[:, None] + s))


def transform_of_equation(alpha, k, illumination, cells=240, nodes=48):
    """(8), with phi of (7) constant in cells of a mesh and the kernel (5) integrated over both cells exactly."""
    edges = 24.0 * np.linspace(0.0, 1.0, cells + 1) ** 2
    width = np.diff(edges)
    t, w = np.polynomial.legendre.leggauss(nodes)
    m, dm = (0.5 * (t + 1.0)) ** 2, 0.5 * (t + 1.0) * w
    s = s_of(m, k)
    kernel = np.zeros((cells, cells))
    for weight, rate in zip(dm / (2.0 * s * m**2), s, strict=True):
        falls = -np.expm1(-rate * width)  # of e^{-rate z} within a cell, over its value at the upper edge
        gap = np.exp(-rate * np.maximum(edges[:-1, None] - edges[None, 1:], 0.0))
        off = np.tril(gap * falls[:, None] * falls / rate**2, -1)
        kernel += weight * (off + off.T + np.diag(2.0 * (width / rate - falls / rate**2)))
    seen = np.array([-np.diff(np.exp(-rate * edges)) / rate for rate in s])  # (nodes, cells) integrals of e^{-s z}
    source = -np.diff(np.exp(-edges)) if illumination == "searchlight" else 2.0 * dm @ seen
    phi = np.linalg.solve(np.diag(width) - alpha * kernel, source)
    return 0.5 * alpha * dm @ seen @ phi


@pytest.mark.parametrize(("k", "z"), [(0.0, 0.7), (0.8, 0.3), (3.0, 1.5)])
def test_the_two_transforms_in_the_plane(k, z):
    """(5) and (6) against the integrals over the plane that they stand for."""
    kernel = 0.5 * quad(lambda r: j0(k * r) * np.exp(-np.hypot(r, z)) / (r**2 + z**2) * r, 0.0, 60.0, **TINY)[0]
    out = quad(lambda r: j0(k * r) * z * np.exp(-np.hypot(r, z)) / np.hypot(r, z) ** 3 * r, 0.0, 60.0, **TINY)[0]
    assert over_m(lambda m: np.exp(-s_of(m, k) * z) / (2.0 * s_of(m, k) * m**2)) == pytest.approx(kernel, rel=1e-8)
    assert over_m(lambda m: np.exp(-s_of(m, k) * z)) == pytest.approx(out, rel=1e-8)  # of both 2 pi times that


@pytest.mark.slow
@pytest.mark.parametrize("illumination", ["searchlight", "diffuse"])
@pytest.mark.parametrize(("alpha", "k"), [(0.5, 0.3), (0.9, 1.5)])
def test_wiener_and_hopf_solve_the_pseudo_problem(alpha, k, illumination):
    """(16), (17) against (7) solved on a mesh, whose error falls with the square of its cells: 1e-4 here."""
    found = transform_of_formula(alpha, k, illumination)
    assert transform_of_equation(alpha, k, illumination) == pytest.approx(found, rel=3e-4)
    assert transform_of_equation(alpha, k + 0.01, illumination) != pytest.approx(found, rel=3e-4)  # it would be seen


@pytest.mark.parametrize(("alpha", "k", "nu"), [(0.5, 0.0, 1.0), (0.9, 0.7, 0.4)])
def test_h_solves_its_equation_and_factors_the_dispersion(alpha, k, nu):
    """(15); and (11) at s = 0, where both factors are H(inf)."""
    root = np.sqrt(1.0 - alpha * (np.arctan(k) / k if k else 1.0))
    rest = over_m(lambda m: h_function(1.0 / s_of(m, k), alpha, k) / ((1.0 + nu * s_of(m, k)) * (1.0 + (k * m) ** 2)))
    assert 1.0 / h_function(nu, alpha, k) == pytest.approx(root + 0.5 * alpha * rest, rel=1e-8)
    assert h_function(1e7, alpha, k) == pytest.approx(1.0 / root, rel=1e-6)


def test_reflectance_and_the_conservative_limit():
    """(18), and 2.91."""
    for alpha in (0.5, 0.99):
        root = np.sqrt(1.0 - alpha)
        flux = over_m(lambda mu, a=alpha: h_function(mu, a, 0.0) * mu)
        assert exact.reflectance(alpha) == pytest.approx(1.0 - h_function(1.0, alpha, 0.0) * root, rel=1e-8)
        assert exact.reflectance(alpha, Setting("diffuse")) == pytest.approx(1.0 - 2.0 * root * flux, rel=1e-8)
    assert h_function(1.0, 1.0, 0.0) == pytest.approx(2.9078, abs=5e-5)


@pytest.mark.parametrize("illumination", ["searchlight", "diffuse"])
def test_the_code_has_the_page_s_transform(illumination):
    """(23): the integral of 2 pi r J0(k r) R_d over the plane, the profile on nodes even in ln r."""
    logs, step = np.linspace(np.log(1e-6), np.log(60.0), 6000, retstep=True)
    r = np.exp(logs)
    energy = step * 2 * np.pi * r**2 * exact.profile(r, 0.8, setting=Setting(illumination))
    for k in (0.5, 2.0):
        assert np.sum(energy * j0(k * r)) == pytest.approx(transform_of_formula(0.8, k, illumination), rel=1e-5)


@pytest.mark.parametrize(("page", "count"), [("exact.md", 27), ("refracting.md", 33)])
def test_every_formula_can_be_drawn(page, count):
    """docutils' translation to MathML ends a fraction without braces too late, and knows no other bold."""
    text = (PAGE.parent / page).read_text(encoding="utf-8")
    blocks = re.findall(r"\$\$(.+?)\$\$", text, re.DOTALL)
    inline = re.findall(r"(?<!\$)\$([^$\n]+)\$(?!\$)", re.sub(r"\$\$.+?\$\$", "", text, flags=re.DOTALL))
    assert len(blocks) == count
    assert all("<math" in tex2mathml(formula.strip()) for formula in (*blocks, *inline))
    assert not re.search(r"\\frac\d|\\boldsymbol", text)


def test_equations_are_numbered_as_the_tests_name_them():
    labels = re.findall(r"^\$\$ \(([\w-]+)\)$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    named = {5: "kernel", 6: "way-out", 7: "pseudo", 8: "out-by-laplace", 11: "factors", 14: "h", 15: "nonlinear"}
    named |= {16: "searchlight", 17: "diffuse", 18: "reflectance", 23: "hankel"}
    assert {number: labels[number - 1] for number in named} == named
