"""Readings of what the paper leaves unsaid, and the constants that its own protocol gives under each.

Source: Liang et al., a subsurface scattering method from an accurate fit of the reflectance profile (Journal of
Software); equation numbers are that paper's. It does not state ring width, ring centre, the quantity that (6) trims,
where its albedos stand or how residuals are weighted, so every choice here is one *reading* with its own constants.

Constants trade against each other, so a reading is judged twice: by its constants and by the curve they draw.
Nothing starts a search at a printed constant: on a surface with a kink the search stays there and "finds" it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from mcml_sim import exact
from mcml_sim.media.arrays import Floats
from mcml_sim.media.setting import Setting
from profilefit.fitting.profiles import Profiles, trimmed_radius, walk
from profilefit.fitting.solver import CONVERGED, Solution, least_squares, solve_batch
from profilefit.laws import published
from profilefit.laws.base import ProfileLaw
from profilefit.materials import BY_NAME, CHANNELS, Material

Content = dict[str, Any]  # a row of the record
EPSILON = 0.005  # of the trimming (6)
# MCML's usual hundredth of a mean free path; beyond 25 mfp (6) never walks for alpha <= .9986 [mfp].
RING_WIDTH, LAST_RADIUS = 0.01, 30.0


@dataclass(frozen=True)
class Protocol7:
    """Choices that (6)-(7) leave open: width of rings, place of their centre, what is trimmed where, what R' carries.

    rings    of the truth merged into one [-]
    centre   "middle", or "corrected": MCML's (i + 1/2 + 1 / (12 (i + 1/2))) dr
    trimmed  "r R_d", R'_d itself, or "R_d"
    stop     "walk" of (6); "stride before" the one where the walk ends; "ring", the first one low enough
    fitted   "r R_d", "2 pi r R_d" or "R_d"
    """

    rings: int = 1
    centre: str = "middle"
    trimmed: str = "r R_d"
    stop: str = "walk"
    fitted: str = "r R_d"

    def describe(self, ring_width: float) -> str:
        rings = f"rings of {self.rings * ring_width:g} l, centre {self.centre}"
        return f"{self.fitted} on {rings}; (6) on {self.trimmed}, stop at the {self.stop}"


@dataclass(frozen=True)
class Coefficients:
    """a, b, c of (7) at each albedo: alpha (m,), values (m, 3) in units of l, cut (m,) r'_max [mfp]."""

    alpha: Floats
    values: Floats
    cut: Floats

    def at(self, alpha: Floats) -> Coefficients:
        where = np.searchsorted(self.alpha, alpha)
        return Coefficients(self.alpha[where], self.values[where], self.cut[where])


def fit_coefficients(profiles: Profiles, protocol: Protocol7, mfp: float = 1.0) -> Coefficients:
    """(7) at each albedo by unweighted least squares over the rings that (6) keeps; `mfp` in units of (6)'s strides."""
    rings, whole = protocol.rings, profiles.energy.shape[1] // protocol.rings  # what is left over at the end is dropped
    energy = profiles.energy[:, : whole * rings].reshape(profiles.alpha.size, whole, rings).sum(axis=2)
    edges, index = profiles.r_edges[: whole * rings + 1 : rings], np.arange(whole) + 0.5
    r = (index + (1 / (12 * index) if protocol.centre == "corrected" else 0.0)) * edges[1]
    value = energy / (np.pi * np.diff(edges**2))
    quantities = {"R_d": value, "r R_d": r * value, "2 pi r R_d": 2 * np.pi * r * value}
    data = quantities[protocol.fitted]
    cut = np.array([cut_radius(r * mfp, row, protocol.stop) / mfp for row in quantities[protocol.trimmed]])
    used = (r <= cut[:, None]).astype(float)
    scale = data[:, :1]
    starts = []
    for y, keep in zip(data / scale, used > 0, strict=True):
        # a, b, c from y (r + c) = a r + b, linear in all three; a plain guess where that has a pole right of 0.
        a, b, c = _amplitudes([r[keep], np.ones_like(r)[keep], -y[keep]], (y * r)[keep])
        starts.append([a, b, c] if c > 0 else [-0.05, 0.5, 0.5])
    solutions = solve_batch(_MISFITS["(7)"], np.array(starts), (np.broadcast_to(r, data.shape), data / scale, used))
    return Coefficients(profiles.alpha, np.stack([s.parameters for s in solutions]) * scale ** [1, 1, 0], cut)


def cut_radius(r: Floats, quantity: Floats, stop: str) -> float:
    """r'_max in the unit of r."""
    if stop == "ring":
        low = quantity <= EPSILON * np.max(quantity)
        return float(r[np.argmax(low)]) if low.any() else float(r[-1])
    end = trimmed_radius(r, quantity, EPSILON)
    return max(x for x in walk(float(r[-1])).tolist() if x < end - 1e-9) if stop == "stride before" else end


def even_rings(alpha: Floats, last: float = LAST_RADIUS) -> Profiles:
    """Return exact light in even rings up to `last` [mfp], to 1e-5: Simpson's rule on a spline of ln(2 pi r R_d)."""
    half = np.arange(2 * round(last / RING_WIDTH) + 1) * RING_WIDTH / 2
    nodes = np.geomspace(half[1] / 2, half[-1], 120)
    values = 2 * np.pi * nodes * np.asarray(exact.profile(nodes, alpha[:, None]))
    density = np.exp(CubicSpline(np.log(nodes), np.log(values), axis=1)(np.log(np.maximum(half, nodes[0]))))
    energy = RING_WIDTH / 6 * (density[:, :-2:2] + 4 * density[:, 1::2] + density[:, 2::2])
    whole = np.asarray(exact.reflectance(alpha))
    energy[:, 0] = whole * np.asarray(exact.cdf(half[2], alpha))  # r ln r at the source defeats Simpson
    none = np.zeros_like(energy)
    return Profiles(alpha, half[::2], energy, none, none + np.inf, whole - energy.sum(axis=1), "exact", Setting())


# A law is reproduced when its curve is within 5 % rms of the printed one over the albedos, and each constant too.
CURVE_TOLERANCE = CONSTANT_TOLERANCE = 0.05
INVERSE_EPSILON = 0.01  # of (19)
LENGTH = "(10), (12), (14)"  # how a, b, c depend on l
_PRINTED = {**published.constants("liang_albedo"), **published.constants("liang")}
PUBLISHED = {
    equation: {name: _PRINTED[name] for name in names.split()}
    for equation, names in {
        "(8)": "p q w",
        "(11)": "a1 a2 a3",
        "(13)": "b0 b1 b2 b3 b4",
        "(15)": "c1 c2 c3",
        "(20)": "g1 g2 g3 g4 h1 h2 h3",
    }.items()
} | {LENGTH: {"a": -1.0, "b": 0.0, "c": 1.0}}
CORRECTED_B0 = published.constants("liang", "corrected")["b0"]
# The printed b0 and what it might be a misprint of, each with the reason to consider it.
B0_CANDIDATES = {
    "as printed": 0.461,
    "digits dropped and swapped: 0.0641": CORRECTED_B0,
    "decimal point: 0.0461": 0.0461,
    "2 pi carried in R': 0.461 / 2 pi": 0.461 / (2 * np.pi),
    "2 pi carried twice: 0.461 / 4 pi^2": 0.461 / (4 * np.pi**2),
}
PROTOCOLS = (
    Protocol7(rings=5),
    Protocol7(stop="ring"),
    Protocol7(stop="stride before"),
    Protocol7(centre="corrected"),
    Protocol7(trimmed="R_d"),
    Protocol7(fitted="2 pi r R_d"),
)
ALPHA_RANGE = np.linspace(0.05, 0.995, 190)  # where curves of a, b, c are compared
REFLECTANCE_RANGE = np.linspace(0.02, 1.0, 99)
INVERSE_ALPHAS, INVERSE_SHARES = np.linspace(0.1, 0.99, 90), np.linspace(0.02, 0.98, 97)


def judge(constant_distance: float, curve_distance: float) -> str:
    """Return the verdict on a reading: the curve decides, the constants say whether the data could pin them."""
    if not curve_distance <= CURVE_TOLERANCE:
        return "not reproduced"
    return "reproduced" if constant_distance <= CONSTANT_TOLERANCE else "curve only"


# The paper's closed forms: R' [1/mfp] of r by (7) and alpha [-] of A by (8); of alpha a [1/mfp], b [-], c [mfp] of (7),
# and k1, k2 [mfp] of (19).
FORMS: dict[str, Callable] = {
    "(7)": lambda r, p: (p[0] * r + p[1]) / (r + p[2]),
    "(8)": lambda x, p: p[0] * x / (x**2 + p[1] * x + p[2]),
    "a": lambda alpha, p: p[0] * alpha + p[1] * 10.0 ** (p[2] * (alpha - 1.0)),  # (9)-(11)
    "b": lambda alpha, p: p[0] * alpha ** ((p[1] * (alpha - p[2]) ** 2 + p[3]) * alpha + p[4]),  # (12)-(13)
    "c": lambda alpha, p: p[0] * np.e ** (p[1] * alpha) + p[2],  # (14)-(15)
    "k1": lambda alpha, p: p[0] * alpha ** (p[1] * alpha ** p[2] + p[3]),  # (20)
    "k2": lambda alpha, p: p[0] * alpha ** (p[1] * alpha + p[2]),  # (20)
}


def samplings() -> dict[str, Floats]:
    """Return grids of albedos: even in alpha, in A, in sqrt(1 - alpha). A choice, and no data."""
    table = np.concatenate([np.linspace(0.01, 0.99, 197), 1.0 - np.geomspace(9e-3, 1e-5, 60)])
    of_reflectance = np.interp(np.linspace(0.05, 0.9, 20), np.asarray(exact.reflectance(table)), table)
    return {
        "alpha even, .05 to .95 and .99": np.append(np.arange(1, 20) / 20, 0.99),
        "A even, 20 from .05 to .9": of_reflectance,
        "sqrt(1 - alpha) even, alpha .05 to .995": 1.0 - np.linspace(np.sqrt(0.95), np.sqrt(0.005), 20) ** 2,
    }


def readings() -> list[Content]:
    """Return every reading of every equation, the winners and their serious competitors, of exact light.

    Each says what it chose, what came out (`constants`, beside those `published`) and how far that is from print:
    constant_distance  the largest |found / printed - 1| of a constant (|found - printed| for exponents of l) [-]
    curve_distance     rms of found curve / printed curve - 1 over its range [-]; curve_maximum its largest
    verdict            `judge` of the two distances
    result             of the fit: "converged", or why its constants are not identified
    """
    grids = samplings()
    profiles = even_rings(np.unique(np.concatenate(list(grids.values()))))
    return [
        *_albedo_readings(grids),
        *_coefficient_readings(profiles, grids),
        *_length_readings(even_rings(np.array([0.5, 0.9, 0.99]))),
        *_inverse_readings(profiles, grids),
    ]


def law_energy(r: Floats, alpha: Floats, b0: float) -> Floats:
    """Return A cdf(r) of (17) [-] at r and alpha, both (m,), with the printed a, c and exponents and this b0."""
    a, b, c = printed_coefficients(alpha, b0)
    return 2 * np.pi * (a * r + (b - a * c) * np.log1p(r / c))


def printed_coefficients(alpha: Floats, b0: float = PUBLISHED["(13)"]["b0"]) -> tuple[Floats, Floats, Floats]:
    """Return a [1/mfp], b [-], c [mfp] of (9)-(15) with printed constants, except b0, which is given."""
    exponents = list(PUBLISHED["(13)"].values())[1:]
    return FORMS["a"](alpha, _printed("(11)")), FORMS["b"](alpha, [b0, *exponents]), FORMS["c"](alpha, _printed("(15)"))


def _printed(equation: str) -> Floats:
    return np.array(list(PUBLISHED[equation].values()))


def _reading(
    equation: str, choices: str, found, curves: tuple[Floats, Floats], evidence: str, printed=None, result=CONVERGED
) -> Content:
    """Measure `found` against print; `curves` are found and printed over the range."""
    printed = printed or PUBLISHED[equation]
    constants = dict(zip(printed, map(float, np.atleast_1d(found)), strict=True))
    of_length = equation == LENGTH
    gaps = [abs(v - printed[k]) if of_length else abs(v / printed[k] - 1) for k, v in constants.items()]
    off = np.abs(curves[0] / curves[1] - 1)
    gap, rms = float(max(gaps)), float(np.sqrt(np.mean(off**2)))
    return {
        **{"equation": equation, "choices": choices, "constants": constants, "published": dict(printed)},
        **{"constant_distance": gap, "curve_distance": rms, "curve_maximum": float(off.max()), "evidence": evidence},
        **{"verdict": judge(gap, rms) if result == CONVERGED else "not reproduced", "result": result},
    }


# One function object a form, so that each compiles once.
_MISFITS = {
    name: lambda p, item, form=form: item[2] * (form(item[0], p) - item[1])  # item: x, data, weight
    for name, form in FORMS.items()
}


def _fit(form: str, x: Floats, data: Floats, start, weight: Floats | float = 1.0) -> Solution:
    """Fit a form by least squares, residuals in units of the largest datum."""
    weights = np.broadcast_to(weight / np.max(np.abs(data)), data.shape)
    # Some have optima far off: steps are measured by the size of what is printed, not by slopes there.
    return least_squares(_MISFITS[form], start, (x, data, weights), scale=np.where(start, np.abs(start), 1.0))


def _amplitudes(columns: list[Floats], data: Floats) -> Floats:  # what multiplies columns, nearest to the data
    return np.asarray(np.linalg.lstsq(np.stack(columns, axis=1), data, rcond=None)[0], np.float64)


def _albedo_readings(grids: dict[str, Floats]) -> list[Content]:
    """(8), a fit of alpha(A): where the albedos stand, and how residuals count."""
    found = []
    hundred = np.arange(1, 100) / 100
    for name, alpha in {**grids, "alpha even, .01 to .99": hundred}.items():
        reflectance = np.asarray(exact.reflectance(alpha))
        weights = {"alpha": np.ones_like(alpha), "alpha, relative": 1 / alpha}
        if alpha is hundred:  # to first order a residual in A, without the kink where (8) has no inverse
            weights = {"A": np.gradient(reflectance, alpha)}
        for residual, weight in weights.items():
            constants = _fit("(8)", reflectance, alpha, [4.0, 2.5, 0.7], weight).parameters
            misfit = np.abs(FORMS["(8)"](reflectance, _printed("(8)")) - alpha)[reflectance <= 0.75].max()
            curves = FORMS["(8)"](REFLECTANCE_RANGE, constants), FORMS["(8)"](REFLECTANCE_RANGE, _printed("(8)"))
            evidence = f"the printed (8) is within {misfit:.4f} of these alphas up to A = .75"
            found.append(_reading("(8)", f"{name}; residual in {residual}", constants, curves, evidence))
    return found


def _coefficient_readings(profiles: Profiles, grids: dict[str, Floats]) -> list[Content]:
    """(11), (13), (15) under the plain protocol at every sampling, and every other protocol at the last one."""
    plain, width = fit_coefficients(profiles, Protocol7()), float(profiles.r_edges[1])
    choices = Protocol7().describe(width)
    last, alpha = list(grids.items())[-1]
    found = []
    for name, here in grids.items():
        found += _law_readings(plain.at(here), f"{choices}; {name}", exponent_free=True)
    rows = np.searchsorted(profiles.alpha, alpha)  # the same rings for some of the albedos only
    names = ("alpha", "energy", "standard_error", "effective_samples", "beyond")
    only = replace(profiles, **{name: getattr(profiles, name)[rows] for name in names})
    for protocol in PROTOCOLS:
        found += _law_readings(fit_coefficients(only, protocol), f"{protocol.describe(width)}; {last}")
    return found + _misprint_readings(plain.at(alpha), f"{choices}; {last}", only)


def _law_readings(points: Coefficients, choices: str, exponent_free: bool = False) -> list[Content]:
    """Return the readings of laws through one set of coefficients, printed exponents fixed and perhaps free as well."""
    alpha, (a, b, c) = points.alpha, points.values.T
    a3, c2 = PUBLISHED["(11)"]["a3"], PUBLISHED["(15)"]["c2"]
    a1, a2 = _amplitudes([alpha, 10.0 ** (a3 * (alpha - 1))], a)
    c1, c3 = _amplitudes([np.exp(c2 * alpha), np.ones_like(alpha)], c)
    b_free = _fit("b", alpha, b, [0.08, 4.0, 0.3, 2.0, 1.0])
    corrected = {**PUBLISHED["(13)"], "b0": CORRECTED_B0}
    cases = [
        ("(11)", "a", a, [a1, a2, a3], "exponent held", PUBLISHED["(11)"]),
        ("(13)", "b", b, b_free, "all free", PUBLISHED["(13)"]),
        ("(13) with b0 = .0641", "b", b, b_free, "all free", corrected),
        ("(15)", "c", c, [c1, c2, c3], "exponent held", PUBLISHED["(15)"]),
    ]
    if exponent_free:
        a_free, c_free = _fit("a", alpha, a, [-0.005, 0.002, 20.0]), _fit("c", alpha, c, [0.02, 3.0, 0.1])
        cases.append(("(11)", "a", a, a_free, "exponent free", PUBLISHED["(11)"]))
        cases.append(("(15)", "c", c, c_free, "exponent free", PUBLISHED["(15)"]))
    cuts, found = f"r'_max {points.cut.min():.2f} to {points.cut.max():.2f} l", []
    for equation, form, data, fit, held, print_set in cases:
        constants, result = (fit.parameters, fit.result) if isinstance(fit, Solution) else (fit, CONVERGED)
        law, printed = FORMS[form], np.array(list(print_set.values()))
        ratio, curves = data / law(alpha, printed), (law(ALPHA_RANGE, constants), law(ALPHA_RANGE, printed))
        evidence = f"{cuts}; coefficient over printed law {ratio.min():.3f} to {ratio.max():.3f}"
        found.append(_reading(equation, f"{choices}; {held}", constants, curves, evidence, print_set, result))
    return found


def _misprint_readings(points: Coefficients, choices: str, profiles: Profiles) -> list[Content]:
    """b0 alone, printed exponents held: which number is it, and does (17) then hold the energy it must?"""
    alpha, b = points.alpha, points.values[:, 1]
    shape = printed_coefficients(alpha, 1.0)[1]
    a_factor = float(np.mean(points.values[:, 0] / printed_coefficients(alpha)[0]))
    found = []
    for why, candidate in B0_CANDIDATES.items():
        r_max = -candidate * shape / printed_coefficients(alpha)[0]
        share = law_energy(r_max, alpha, candidate) / profiles.reflectance
        evidence = (
            f"cdf(r_max) of (17), which must be 1: {share.min():.3f} to {share.max():.3f}; r_max {r_max.min():.1f} to "
            f"{r_max.max():.1f} l; a of the same fits is {a_factor:.3f} of print: no factor missing"
        )
        b0, curves = shape @ b / (shape @ shape), (b, candidate * shape)
        found.append(_reading("(13) b0", f"{why}; {choices}", b0, curves, evidence, {"b0": candidate}))
    return found


def _length_readings(profiles: Profiles) -> list[Content]:
    """Exponents of l: strides of (6) stay as they are while the mean free path changes, rings scale with it."""
    lengths = np.geomspace(0.1, 10.0, 7)
    powers = {"r R_d": (-1, 0, 1), "R_d": (-2, -1, 1)}  # of l in a, b, c, by dimension
    found = []
    for fitted, power in powers.items():
        protocol = Protocol7(fitted=fitted, trimmed="r R_d")
        units = lengths[:, None, None] ** np.array(power, float)
        values = units * np.stack([fit_coefficients(profiles, protocol, mfp).values for mfp in lengths])
        slopes = np.polyfit(np.log(lengths), np.log(np.abs(values)).reshape(lengths.size, -1), 1)[0].reshape(-1, 3)
        mean, printed = slopes.mean(axis=0), np.array([-1.0, 0.0, 1.0])
        spread = ", ".join(f"{low:.3f} to {high:.3f}" for low, high in zip(slopes.min(0), slopes.max(0), strict=True))
        curves = lengths[:, None] ** mean, lengths[:, None] ** printed
        evidence = f"alpha .5, .9, .99: exponents of a, b, c {spread}"
        choices = f"{fitted} fitted; l .1 to 10 units of the strides of (6), rings of {profiles.r_edges[1]:g} l"
        found.append(_reading(LENGTH, choices, mean, curves, evidence))
    return found


def _inverse_readings(profiles: Profiles, grids: dict[str, Floats]) -> list[Content]:
    """(19)-(20): where shares stand and what is made small; k1 and k2 by linear least squares at each albedo."""
    wanted = [*np.arange(1, 10) / 10, 0.95, 0.99]
    chosen = profiles.alpha[[np.argmin(np.abs(profiles.alpha - a)) for a in wanted]]
    rows = [profiles.cdf[i] for i in np.searchsorted(profiles.alpha, chosen)]
    edges = profiles.r_edges
    cuts = fit_coefficients(profiles, Protocol7()).at(chosen).cut
    even = np.arange(1, 100) / 100

    def within(shares: Floats, keep: NDArray[np.bool_]) -> tuple[Floats, Floats]:  # r = 0 left out
        return shares[1:][keep[1:]], edges[1:][keep[1:]]

    by_share = [(even, np.interp(even, row, edges)) for row in rows]
    by_ring = [within(row, row <= 0.95) for row in rows]
    by_cut = [within(row, edges <= cut) for row, cut in zip(rows, cuts, strict=True)]
    by_law = []
    for alpha in map(np.array, chosen.tolist()):  # the paper's own cdf (17) after (18)
        a, b, _ = printed_coefficients(alpha, CORRECTED_B0)
        r = np.linspace(0.0, -b / a, 4001)
        energy = law_energy(r, alpha, CORRECTED_B0)
        by_law.append((even, np.interp(even, energy / energy[-1], r)))
    cases = (
        ("rings to cdf = .95", by_ring, "r, relative"),
        ("xi even, .01 to .99", by_share, "xi"),
        ("xi even, .01 to .99", by_share, "r"),
        ("rings to r'_max of (6)", by_cut, "r"),
        ("(17) with b0 = .0641 for truth, xi even, .01 to .99", by_law, "xi"),
    )
    return [_inverse_reading(chosen, points, residual, name) for name, points, residual in cases]


def _inverse_reading(alpha: Floats, points, residual: str, name: str) -> Content:
    amplitudes = []
    for xi, r in points:  # k1, k2 [mfp] of (19), linear in both; a residual in xi is one in r times the density
        shape = np.sqrt(xi) * np.log(1 + INVERSE_EPSILON - xi)
        weight = {"r": np.ones_like(r), "r, relative": 1 / r, "xi": np.gradient(xi, r)}[residual]
        amplitudes.append(_amplitudes([xi * shape * weight, -shape * weight], r * weight))
    k1, k2 = np.stack(amplitudes).T
    fits = _fit("k1", alpha, k1, [1.2, 2.0, 0.5, 0.3]), _fit("k2", alpha, k2, [3.0, 2.5, 0.4])
    found = np.concatenate([one.parameters for one in fits])
    printed = _printed("(20)")  # sqrt(xi) ln(1 + eps - xi) is in both curves: only the bracket of (19) differs
    curves = _bracket(found), _bracket(printed)
    laws = FORMS["k1"](alpha, printed[:4]), FORMS["k2"](alpha, printed[4:])
    off = [float(np.sqrt(np.mean((k / law - 1) ** 2))) for k, law in zip((k1, k2), laws, strict=True)]
    evidence = f"alpha .1 to .9 by .1, .95, .99: k1, k2 at each one are {off[0]:.3f}, {off[1]:.3f} rms from (20)"
    return _reading("(20)", f"{name}; residual in {residual}", found, curves, evidence)


def _bracket(p: Floats) -> Floats:  # k1 xi - k2 of (19), (alphas, shares)
    k1, k2 = FORMS["k1"](INVERSE_ALPHAS, p[:4]), FORMS["k2"](INVERSE_ALPHAS, p[4:])
    return k1[:, None] * INVERSE_SHARES - k2[:, None]


# Table 1
PRINTED_B0 = PUBLISHED["(13)"]["b0"]
NORMALIZED_DIFFUSION = "normalized diffusion"
# model name -> (b0 of (13), whether (18) divides)
RATIONAL_MODELS = {
    "paper as printed": (PRINTED_B0, False),
    "paper as printed, with (18)": (PRINTED_B0, True),
    "paper, b0 = .0641": (CORRECTED_B0, False),
    "paper, b0 = .0641, with (18)": (CORRECTED_B0, True),
}
# The materials of table 1 and which of ours they may be.
CANDIDATES = {"ketchup": ("ketchup",), "apple": ("apple",), "marble": ("marble",), "skin": ("skin1", "skin2")}
# material, model -> MSE of r <= 1/2, of r > 1/2 and of all [1/mm^2], then R^2 of the same [-]
PRINTED = {
    ("ketchup", "diffusion"): ((9.7448e-8, 4.5326e-9, 5.0975e-8), (0.9898, 0.5027, 0.9934)),
    ("ketchup", "paper"): ((7.1351e-8, 1.1414e-8, 4.1373e-8), (0.9916, 0.8809, 0.9942)),
    ("apple", "diffusion"): ((2.5702e-5, 1.7925e-6, 1.3741e-5), (0.9801, 0.5010, 0.9853)),
    ("apple", "paper"): ((6.8160e-6, 7.7950e-7, 3.7812e-6), (0.9941, 0.8581, 0.9954)),
    ("marble", "diffusion"): ((2.4810e-5, 1.7023e-6, 1.3256e-5), (0.9789, 0.5012, 0.9844)),
    ("marble", "paper"): ((6.7710e-6, 7.2461e-7, 3.7478e-6), (0.9936, 0.8476, 0.9950)),
    ("skin", "diffusion"): ((1.8591e-6, 4.5615e-8, 9.5236e-7), (0.9855, 0.5038, 0.9912)),
    ("skin", "paper"): ((7.7719e-7, 1.5203e-7, 4.6461e-7), (0.9944, 0.8982, 0.9960)),
}
Triple = tuple[float, float, float]


def table1(regenerated: Mapping[str, ProfileLaw]) -> list[Content]:
    """Return the paper's table of errors, recomputed: MSE and R^2 of r R_d for two halves of the range and all.

    Every candidate material, channel, range and model; `regenerated` are further models by name. Table 1 states neither
    channel, range, ring width, nor which R^2, and "skin" is one of two materials: each choice is a
    row, and nothing decides between them but the distance to print.

    range_mm  r'_max [mm], and how it was chosen; rings are those of the truth
    mse       of r <= r'_max / 2, of the rest, of all [1/mm^2], and over the printed ones [-]
    r2        of the same three, and less the printed ones, by definition: "determination" 1 - SSE/SST, "explained"
              SSR / (SSR + SSE), "correlation" squared
    """
    found: list[Content] = []
    for printed, names in CANDIDATES.items():
        for material in map(BY_NAME.__getitem__, names):
            profiles = even_rings(np.array(material.alpha))
            for channel in range(len(CHANNELS)):
                found += _channel_rows(printed, material, channel, profiles, regenerated)
    return found


def printed_halves() -> list[Content]:
    """Check that printed halves, of equally many rings (give or take one), average to the printed whole.

    off  mean of the halves over the whole, less 1 [-]; second_half_needed  the second half that would make it 0
    """
    found = []
    for (material, model), ((first, second, whole), _) in PRINTED.items():
        off, needed = (first + second) / 2 / whole - 1, 2 * whole - first
        found.append({"material": material, "model": model, "off": off, "second_half_needed": needed})
    return found


def mean_squared_errors(law: Floats, data: Floats) -> Triple:
    """Return values of the first half of the samples, the second half and all."""
    first, second, whole = (float(np.mean((law[s] - data[s]) ** 2)) for s in _halves(data.size))
    return first, second, whole


def r_squared(law: Floats, data: Floats) -> dict[str, Triple]:
    """R^2 by three definitions, equal for a linear regression and for nothing else, halves and all."""
    by_part = [_r_squared_of(law[s], data[s]) for s in _halves(data.size)]
    return {name: (by_part[0][name], by_part[1][name], by_part[2][name]) for name in by_part[0]}


def normalized_diffusion(r: Floats, reflectance: float, mfp: float) -> Floats:
    """Return r R_d [1/length] of Christensen and Burley (2015) under a pencil beam: s = 1.85 - A + 7 |A - .8|^3."""
    s = 1.85 - reflectance + 7 * abs(reflectance - 0.8) ** 3
    return reflectance * s / (8 * np.pi * mfp) * (np.exp(-s * r / mfp) + np.exp(-s * r / (3 * mfp)))


def rational(r: Floats, alpha: float, reflectance: float, mfp: float, b0: float, corrected: bool) -> Floats:
    """Return r R_d [1/length] of (7), zero beyond r_max, divided by cdf(r_max) of (18) if `corrected`."""
    a, b, c = printed_coefficients(np.array(alpha), b0)
    value = np.maximum(FORMS["(7)"](r / mfp, (a, b, c)), 0.0) / mfp
    return value * reflectance / law_energy(-b / a, np.array(alpha), b0) if corrected else value


def _channel_rows(
    printed: str, material: Material, channel: int, profiles: Profiles, regenerated: Mapping[str, ProfileLaw]
) -> list[Content]:
    alpha, mfp = material.alpha[channel], material.mfp[channel]
    r = profiles.r * mfp
    data = profiles.value[channel] * profiles.r / mfp
    reflectance = float(profiles.reflectance[channel])
    laws = {NORMALIZED_DIFFUSION: normalized_diffusion(r, reflectance, mfp)}
    for model, (b0, corrected) in RATIONAL_MODELS.items():
        laws[model] = rational(r, alpha, reflectance, mfp, b0, corrected)
    laws |= {model: r * np.asarray(law.profile(r, alpha, mfp)) for model, law in regenerated.items()}
    # Ranges r'_max [mm], whole or below 5 mm half; the nearest is that whose three MSEs of diffusion are so to print.
    ends = np.append(np.arange(0.5, 5.0, 0.5), np.arange(5.0, 31.0))
    ends, law, target = ends[ends <= r[-1]], laws[NORMALIZED_DIFFUSION], np.log(PRINTED[printed, "diffusion"][0])
    misfits = [np.sum((np.log(mean_squared_errors(law[r <= e], data[r <= e])) - target) ** 2) for e in ends]
    ranges = {
        "(6) on r R_d": cut_radius(r, data, "walk"),
        "one stride before (6)": cut_radius(r, data, "stride before"),
        "diffusion's MSE nearest to print": float(ends[np.argmin(misfits)]),
    }
    found = []
    for (choice, end), (model, law) in product(ranges.items(), laws.items()):
        values = law[r <= end], data[r <= end]
        mse, r2 = mean_squared_errors(*values), r_squared(*values)
        printed_mse, printed_r2 = PRINTED[printed, "diffusion" if model.startswith(NORMALIZED_DIFFUSION) else "paper"]
        over = tuple(one / other for one, other in zip(mse, printed_mse, strict=True))
        gaps = {name: tuple(x - y for x, y in zip(own, printed_r2, strict=True)) for name, own in r2.items()}
        of: dict[str, Any] = {"material": material.name, "channel": CHANNELS[channel], "model": model}
        of |= {"range_choice": choice, "range_mm": end}
        found.append({**of, "mse": mse, "r2": r2, "mse_over_printed": over, "r2_minus_printed": gaps})
    return found


def _r_squared_of(law: Floats, data: Floats) -> dict[str, float]:
    residual = np.sum((law - data) ** 2)
    explained = np.sum((law - data.mean()) ** 2)
    joint = np.sum((law - law.mean()) * (data - data.mean())) ** 2
    spread = np.sum((law - law.mean()) ** 2) * np.sum((data - data.mean()) ** 2)
    return {
        "determination": float(1 - residual / np.sum((data - data.mean()) ** 2)),
        "explained": float(explained / (explained + residual)),
        "correlation": float(joint / spread) if spread > 0 else 0.0,
    }


def _halves(size: int) -> tuple[slice, slice, slice]:
    return slice(0, size // 2), slice(size // 2, size), slice(0, size)
