"""Phase functions fitted to tables: Petzold's mean, one that is known, bad tables, and the shipped record."""

import shutil
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim.media.phase import HenyeyGreenstein, Mixture
from profilefit.laws.phases import FORMS, backscattered, haltrin
from profilefit.recipes.folder import shipped
from profilefit.recipes.kinds import phase as record
from profilefit.recipes.phases import MOMENTS, fit_phase, read_phase
from tests.fixtures import recorded, refused, slow
from tests.unit.recipes.stack.test_record import GONE, RUN, refused_record, spoil

ROOT = Path(__file__).resolve().parents[3]
FOLDER = shipped("fits") / "phases"
PETZOLD = read_phase(FOLDER / "petzold.csv")
SHIPPED = record.load(FOLDER / "petzold.json")
KNOWN = Mixture((0.7, 0.3), (HenyeyGreenstein(0.95), HenyeyGreenstein(0.3)))


DEGREES = np.append(np.geomspace(0.1, 10, 30), np.linspace(15, 180, 34))


def table(path, phase, sigma=0.0, noise=0.0, degrees=DEGREES):
    values = phase.pdf(np.cos(np.radians(degrees)))
    values = values * np.exp(noise * np.random.default_rng(1).standard_normal(values.size))
    head = "angle [deg], value [1/sr]" + (", sigma" if sigma else "")
    rows = [f"{a:.6g}, {v:.9g}" + (f", {sigma * v:.6g}" if sigma else "") for a, v in zip(degrees, values, strict=True)]
    path.write_text("\n".join(["# made", head, *rows]))
    return path


def test_haltrin_as_published():
    """Both ends, and a value between by hand."""
    assert haltrin(1.0) == (pytest.approx(1.0), 1.0, pytest.approx(0.71259756))
    weight, g, h = haltrin(0.9)
    assert h == pytest.approx(-0.3061446 + 0.9 * 1.000568 - 0.81 * 0.01826332 + 0.729 * 0.03643748)
    assert weight == pytest.approx(h * (1 + h) / ((g + h) * (1 + h - g)))
    # The condition that the weight comes from: the mean of P_2 is the mean cosine.
    both = Mixture((weight, 1 - weight), (HenyeyGreenstein(g), HenyeyGreenstein(-h)))
    assert both.moment(2) == pytest.approx(both.mean_cosine, abs=1e-12)
    assert abs(haltrin(0.30665).h) < 1e-4
    for beyond in (0.30664, 0.0, -0.5, 1.0001, float("nan"), True, "0.9", None):
        refused(r"g must be in \(0.30664, 1\], got", haltrin, beyond)


@pytest.mark.parametrize("name", ["1-term", "2-terms", "haltrin", *slow("3-terms", "4-terms", "fournier-forand")])
def test_every_form_is_a_phase_function(name):
    """Normalised, its moments those of the form that a fit uses, and differentiable, wherever fits start from."""
    form = FORMS[name]
    for start in form.starts(np.random.default_rng(2), 2):
        with jax.enable_x64(True):
            constants = form.constants(jnp.asarray(start))
            assert constants.shape == (len(form.names),)
            slope = np.asarray(jax.jacfwd(lambda p: form.mean_cosine(form.constants(p)))(jnp.asarray(start)))
            mean = float(form.mean_cosine(constants))
        assert np.all(np.isfinite(slope))
        assert start.shape == (form.free,)
        x = np.cos(np.geomspace(np.pi, 1e-4, 40_001))
        p = np.asarray(form.phase(np.asarray(constants)).pdf(x))
        total = 2 * np.pi * np.trapezoid(p, x)
        left = 1 - float(form.phase(np.asarray(constants)).invert(np.cos(1e-4)))
        assert total + left == pytest.approx(1, abs=5e-4)
        assert mean == pytest.approx(2 * np.pi * np.trapezoid(p * x, x) + left, abs=5e-4)


SCALES = [
    (1.0, " [1/sr]", "over all directions, 0.9993."),
    (0.4367, " [1/(m sr)]", "over all directions, b = 0.4364 1/m."),
    (0.4367, " [cm^-1 sr^-1]", "over all directions, b = 0.4364 1/cm."),
    (4 * np.pi, "", "over all directions, 12.56 (4 pi times 0.9993)."),
]


@pytest.mark.parametrize(("factor", "unit", "line"), SCALES)
def test_a_table_of_any_scale_with_a_row_at_zero(tmp_path, factor, unit, line):
    degrees, path = np.arange(181.0), tmp_path / "table.csv"
    values = factor * HenyeyGreenstein(0.8).pdf(np.cos(np.radians(degrees)))
    rows = (f"{a:g}, {value:.12g}, {factor * 1e-3}\n" for a, value in zip(degrees, values, strict=True))
    path.write_text(f"angle [deg], value{unit}, sigma\n" + "".join(rows))
    data = read_phase(path)
    assert (data.integral, data.mean_cosine) == (pytest.approx(factor, rel=1e-3), pytest.approx(0.8, abs=1e-3))
    assert data.sigma[0] == pytest.approx(1e-3 * factor / values[0])
    lines = record.table_lines(record.described(data))
    assert lines[0].endswith(line)
    assert "row at 0 degrees" in lines[1]


def test_a_known_function_comes_back(tmp_path):
    """With a row at 0, too, which is in the moments and in no fit.

    Fournier and Forand's form is infinite there, and so is ln angle, along which the misfit is correlated.
    """
    for degrees in (DEGREES, np.append(0.0, DEGREES)):
        data = read_phase(table(tmp_path / "known.csv", KNOWN, degrees=degrees))
        found = fit_phase(data, "2-terms")
        np.testing.assert_allclose(found.constants, [0.95, 0.3, 0.7, 0.3], atol=2e-3)
        if degrees[0] > 0:
            assert found.rms < 5e-3  # what the table's own pieces leave of its integral
            assert fit_phase(data, "1-term").rms > 0.3
    assert found.moments == (data.mean_cosine, data.backscattered)
    assert all(np.all(np.isfinite(error)) for error in found.errors.values() if error is not None)


def test_shares_of_angles_without_rows(tmp_path):
    """Of an isotropic function (cos low - cos high) / 2 by either rule; of another one the rules enclose it."""
    degrees = np.array([1.0, 3, 10, 20, 40, 60.5, 70, 80, 85, 115, 120, 140])
    named = [(0.0, 1.0), (40.0, 60.5), (85.0, 115.0), (140.0, 180.0)]
    for phase in (HenyeyGreenstein(0.0), HenyeyGreenstein(0.7), KNOWN):
        data = read_phase(table(tmp_path / "table.csv", phase, degrees=degrees))
        assert [(span["low"], span["high"]) for span in data.spans] == [pytest.approx(one) for one in named]
        for span in data.spans:
            ends = np.cos(np.radians([span["low"], span["high"]]))
            share, both = float(np.ptp(phase.invert(ends))) / data.integral, (span["share"], span["other"])
            if phase.mean_cosine == 0:
                assert both == pytest.approx((share, share), rel=1e-5)
            else:
                assert min(both) * 0.99 < share < max(both) * 1.01


def test_the_lines_of_the_guide(tmp_path):
    path, degrees = tmp_path / "gaps.csv", np.degrees(PETZOLD.angles)
    kept = (degrees > 0.3) & ((degrees < 26) | (degrees > 64)) & (degrees < 161)
    values = 0.4367 * PETZOLD.integral * PETZOLD.values
    rows = (f"{a:.6g}, {value:.9g}\n" for a, value in zip(degrees[kept], values[kept], strict=True))
    path.write_text("angle, value [1/(m sr)]\n" + "".join(rows))
    words = " ".join(record.table_lines(record.described(read_phase(path)))).split()
    assert " ".join(words) in " ".join((ROOT / "docs/explanation/phases.md").read_text().split())


def test_a_first_gap_under_a_row_at_zero_and_a_last_row_that_is_noise(tmp_path):
    """A peak that 5 degrees do not resolve: the scale is 30 % off, and the difference of both rules says so."""
    data = read_phase(table(tmp_path / "table.csv", HenyeyGreenstein(0.95), degrees=np.arange(0.0, 181, 5)))
    (span,) = data.spans
    assert (span["low"], span["high"]) == (0.0, pytest.approx(5.0))
    assert data.integral == pytest.approx(1.325, abs=1e-3)
    right = 1 - HenyeyGreenstein(0.95).invert(np.cos(np.radians(5.0)))
    assert span["other"] * data.integral < right < span["share"] * data.integral
    assert abs(data.integral - 1) < (span["share"] - span["other"]) * data.integral
    # Two rows side by side, the last of which is noise, do not decide what lies beyond, and no share is infinite.
    path, rows = tmp_path / "noise.csv", "".join(f"{a}, 0.08\n" for a in range(1, 151))
    for last, other in ((0.09, pytest.approx(0.0759, rel=0.05)), (1e300, 1e3)):
        path.write_text(f"{HEAD}{rows}150.01, {last}\n")
        assert read_phase(path).spans[-1]["other"] == other


def test_statistical_errors_are_those_of_the_noise(tmp_path):
    """z of four constants under a noise of 3 %, as it is given and thought ten times smaller."""
    found = fit_phase(read_phase(table(tmp_path / "noisy.csv", KNOWN, 0.03, 0.03)), "2-terms")
    off, errors = np.abs(found.constants - [0.95, 0.3, 0.7, 0.3]), found.errors
    assert np.all(off < 3.5 * errors["statistical_error"])
    assert np.any(off > 3.5 * errors["statistical_error"] / 10)
    assert errors["discretisation_error"] is None
    for name in ("model_error", "misfit_error", "jackknife_error"):
        assert np.all((errors[name] < 5 * errors["statistical_error"]) & (errors[name] > 0)), name


def test_moments_are_kept_and_angles_count():
    """From 1 degree on one term is nearer: a quarter of all scattering is left out."""
    found = fit_phase(PETZOLD, "2-terms", MOMENTS)
    assert found.mean_cosine == pytest.approx(PETZOLD.mean_cosine, rel=1e-3)
    assert (found.backscattered, found.result) == (pytest.approx(PETZOLD.backscattered, rel=1e-3), "converged")
    assert fit_phase(PETZOLD, "2-terms").rms < found.rms
    every, some = fit_phase(PETZOLD, "1-term"), fit_phase(PETZOLD, "1-term", angles=(1.0, 180.0))
    assert some.rms < 0.7 * every.rms
    assert np.isnan(some.bands[0])


@pytest.mark.slow
def test_what_cannot_keep_both_says_so():
    found = fit_phase(PETZOLD, "fournier-forand", MOMENTS)
    assert found.result == "backscattered cannot be kept by this form"
    assert fit_phase(PETZOLD, "1-term", MOMENTS[:1]).result == "converged"


def test_shipped_record():
    """What it promises of Petzold's mean, at the moments of the table; `make test-all` fits it again."""
    data, phases = SHIPPED.content["data"], SHIPPED.content["phases"]
    assert SHIPPED.content["data_digest"] == PETZOLD.digest
    assert phases["3-terms"]["held"]["rms"] < 0.171
    assert phases["4-terms"]["held"]["rms"] < 0.07
    assert phases["fournier-forand"]["free"]["rms"] < 0.092
    assert phases["haltrin"]["free"]["rms"] > 1.0
    for form in ("3-terms", "4-terms"):
        phase = SHIPPED.phase(form)
        assert phase.mean_cosine == pytest.approx(data["mean_cosine"], rel=1e-3)
        assert backscattered(phase) == pytest.approx(data["backscattered"], rel=1e-3)
        off = np.log(phase.pdf(np.cos(PETZOLD.angles)) / PETZOLD.values)
        assert np.sqrt(np.mean(off**2)) == pytest.approx(phases[form]["held"]["rms"], rel=1e-6)
    # Neither premise of Haltrin's form holds.
    assert data["mean_cosine"] - data["second"] > 0.06
    assert data["regression"] - data["mean_cosine"] > 0.03
    assert record.named("petzold").content == SHIPPED.content
    # An older record than units and spans.
    line = "petzold.csv: values were divided by their integral over all directions, 0.9924."
    assert record.table_lines(data) == [line]
    refused(r"must be one of petzold, or a \.json, got 'baltic'", record.named, "baltic")


@pytest.mark.slow
def test_the_record_comes_out_again(tmp_path):
    said = []
    again = record.load(recorded(record.fit(FOLDER / "petzold.csv", RUN), tmp_path, say=said.append))
    assert said[:-1] == record.table_lines(again.content["data"])
    assert len(said) == 4
    for name, one in SHIPPED.content["constants"].items():
        error = max(value for key, value in one.items() if key.endswith("error") and value is not None)
        assert abs(again.content["constants"][name]["regenerated"] - one["regenerated"]) <= 0.01 * error + 1e-9, name


HEAD = "angle [deg], value [1/sr]\n"
ROWS = "".join(f"{a}, {1 / (4 * np.pi):.9f}\n" for a in (1, 10, 30, 60, 90, 120, 150, 180))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected a header of angle .*, got an empty file"),
        ("angle, p\n" + ROWS, ":1: expected a header of angle .*, got 'p'"),
        ("angle [rad], value\n" + ROWS, r":1: angle must be in deg, degrees or without a unit, got .rad."),
        ("angle\n" + ROWS, ":1: expected a header of angle .*, got 'angle'"),
        (HEAD + "1, 2\n", "expected 8 to 5000 rows under the header, got 1"),
        (HEAD + ROWS + "170, 0.08\n", r":10: expected an angle in \[0, 180\] degrees that rises, got 170"),
        (HEAD + "0, 1\n0, 1\n" + ROWS, ":3: expected an angle in .* that rises, got 0"),
        (HEAD + ROWS.replace("60,", "nan,"), ":5: column angle: expected a finite number, got 'nan'"),
        (HEAD + ROWS.replace("60, ", "60, -"), ":5: expected a value > 0, got -0.0795775"),
        (HEAD + ROWS.replace("60, ", "60, 3, "), ":5: expected 2 cells, as the header has, got 3"),
        (HEAD + "".join(f"{0.3 * i}, 0.08\n" for i in range(1, 11)), "angles in degrees up to 180, got 3 at most"),
        (HEAD + "0.1, 9000\n" + ROWS, r"slower than angle\^-2, .*, got angle\^-5.05: a row at 0 degrees"),
        (HEAD.replace("1/sr", "1/m"), r":1: value must be in 1/sr, .* or without a unit, got .1/m."),
        ("angle, value [1/(m sr)], sigma [1/sr]\n" + ROWS, r":1: sigma must be in the unit of value, 1/\(m sr\), or"),
        (HEAD + ROWS.replace("0.079577472", "9e307"), "expected values whose integral is finite and > 0, got "),
        ("angle, value, sigma\n" + ROWS.replace("\n", ", 0\n"), ":2: expected a sigma > 0, got 0"),
        (b"angle, value\n\xff\n", r"table\.csv:2: expected text in UTF-8, got the byte 0xff"),
        ("#" * (2**20 + 10), "at most 1048576 bytes"),
    ],
)
def test_bad_tables_in_one_line(tmp_path, text, message):
    path = tmp_path / "table.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    assert str(path) in refused(message, read_phase, path)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"form": "5-terms"}, "form must be one of 1-term, .*, got '5-terms'"),
        ({"form": "1-term", "hold": MOMENTS}, "hold must be at most 1 of the moments for 1-term, got 2"),
        ({"form": "2-terms", "hold": ("norm",)}, "hold must be of mean_cosine, backscattered, got 'norm'"),
        ({"form": "4-terms", "angles": (100.0, 120.0)}, "angles must hold 14 rows or more for 4-terms, got 5"),
    ],
)
def test_questions_that_have_no_answer(arguments, message):
    refused(message, fit_phase, PETZOLD, **arguments)


@pytest.mark.parametrize(
    ("place", "value", "message"),
    [
        ("data/spans", [{"low": "none"}], r"\[data.spans 1\] low must be a finite number"),
        ("constants/4-terms.held.w1/regenerated", 0.9, r"petzold\.json: is damaged: weights must sum to 1"),
        ("constants/4-terms.held.w1", GONE, r"\[constants\] 4-terms.held.w1 must be a table, got nothing"),
        ("phases/haltrin/free/rms", "small", r"\[phases.haltrin.free\] rms must be a finite number"),
        ("pipeline", "profile", "must be a record of phase functions, got pipeline 'profile'"),
    ],
)
def test_damaged_records(tmp_path, place, value, message):
    path = Path(shutil.copy(FOLDER / "petzold.json", tmp_path))
    spoil(path, place, value)
    refused_record(lambda path: record.load(path).phase("4-terms"), path, message)
