"""What a fit takes for granted: as options, else as the file states, else assumed. From a file to an answer in one call
is what its parts give, and names what cannot be asked.
"""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import profilefit
from mcml_sim import Layer, Medium, Setting, half_space, phase
from profilefit.errors import SettingError
from profilefit.measured import Known, fit, read
from profilefit.measured.fitting import fitted
from profilefit.measured.instrument import Gaussian, TopHat
from profilefit.measured.noise import origin
from profilefit.measured.premises import Premises, premises
from profilefit.measured.problem import FitSpec
from profilefit.measured.reading import FACTS
from profilefit.measured.result import known_medium
from profilefit.recipes.catalogue import fits_folder
from tests.fixtures import refused

DATA = Path(__file__).parents[3] / "examples"
ROWS = "r [mm],value,sigma\n0.5,0.1,0.01\n1,0.05,0.01\n2,0.01,0.001\n"


@pytest.fixture
def stated(tmp_path):
    def write(comments, rows=ROWS):
        path = tmp_path / "own.csv"
        path.write_text(comments + rows)
        return read(path)

    return write


def test_a_file_states_and_options_go_before_it(stated):
    assert premises(stated("# measured by hand\n")) == Premises(Setting(), assumed=("n", "g")), "nothing told"
    data = stated("# n = 1.4\n# G: 0.9\n# beam = 0.5mm\n# light=diffuse\n")
    found = premises(data)
    assert (found.setting, found.instrument.beam, found.assumed) == (Setting("diffuse", 1.4, 0.9), Gaussian(0.5), ())
    assert premises(data, options={"g": "0.8", "beam": None}).setting.g == 0.8
    assert stated("# unit = cm\n", ROWS.replace(" [mm]", "")).unit == "cm"
    assert premises(stated("", ROWS + "# n = 1.4\n")).setting.n == 1.4, "wherever the comment stands"


@pytest.mark.parametrize(
    ("lines", "setting", "beam", "fibre", "unit"),
    [
        (("illumination = diffuse", "Illumination: diffuse", "LIGHT = diffuse", "lighting:diffuse", "light =diffuse"),
         Setting("diffuse"), None, 0.0, "mm"),
        (("N: 1.4", "refractive index = 1.4", "Refractive_Index: 1.4", "index of refraction (633 nm) = 1.4", "n=1.4"),
         Setting(n=1.4), None, 0.0, "mm"),
        (("G: 0.8", "anisotropy = 0.8", "mean cosine: 0.8", "anisotropy-factor (g) = 0.8", "# g=0.8"),
         Setting(g=0.8), None, 0.0, "mm"),
        (("Beam: 0.5mm", "beam radius [mm] = 0.5", "1/e^2 radius = 0.5 mm", "spot_radius = 500um", "beam = 0.5"),
         Setting(), Gaussian(0.5), 0.0, "mm"),
        (("fiber = 0.2mm", "Fibre core radius: 0.2 mm", "core radius (mm) = 0.2", "fibre_radius=200um", "FIBRE: 0.2"),
         Setting(), None, 0.2, "mm"),
        (("units = cm", "Unit: cm", "unit of r = cm", "length_unit: cm", "UNITS of R =cm"), Setting(), None, 0.0, "cm"),
    ],
)  # fmt: skip
def test_each_fact_is_read_under_five_spellings(stated, lines, setting, beam, fibre, unit):
    for line in lines:
        data = stated(f"# {line}\n", ROWS if unit == "mm" else ROWS.replace(" [mm]", ""))
        found = premises(data)
        assert (found.setting, found.instrument.beam, data.unit) == (setting, beam, unit), line
        assert found.instrument.fibre == pytest.approx(fibre), line
        assert data.notes == found.notes == (), line


def test_what_comments_state_besides_is_told_in_one_line(stated):
    others = ("beam diameter = 1 mm", "NA: 0.22", "wavelength [nm] = 633", "Refr. index=1.4", "fibre diameter = .4mm")
    for other in others:
        (note,) = stated(f"# measured by hand, see https://example.org\n# columns:\n# {other}\n").notes
        name = other.partition(":" if ":" in other else "=")[0].strip()
        assert note == f"comments state what is not understood: '{name}' (line 3); known are {', '.join(FACTS)}"
    (note,) = stated("".join(f"# {other}\n" for other in (*others, "date: today", "by = me"))).notes
    assert "'beam diameter' (line 1), " in note
    assert note.endswith(f"(line 5) and 2 more; known are {', '.join(FACTS)}")
    assert stated("# 0.3: the first row\n# as said by those who have measured it: noise\n").notes == ()


def test_an_option_in_place_of_a_fact_is_noted(stated):
    data = stated("# n = 1.4\n# g = 0.9\n# unit = mm\n", ROWS.replace(" [mm]", ""))
    assert premises(data, options={"n": "1.33", "g": "0.9"}, names={"n": "--n"}).notes == (
        "the file's n is '1.4' (line 1), fitted with --n 1.33",
    )
    found = fit(data, setting=premises(data, options={"n": "1.33"}), walk=False).fit.data.notes
    assert found == ("the file's n is '1.4' (line 1), fitted with n 1.33",)
    converted = read(Path(data.source), unit="cm")
    assert converted.notes == ("the file's unit is 'mm' (line 3), read with `unit` cm",)


def test_a_full_width_at_half_maximum_is_a_beam(stated):
    """exp(-2 r^2 / w^2) is 1/2 at r = w sqrt(ln 2 / 2)."""
    for text, w in (("fwhm:0.2mm", 0.1698643600577), ("FWHM:.02cm", 0.1698643600577), ("0.5mm", 0.5)):
        beam = premises(stated(f"# beam = {text}\n")).instrument.beam
        assert beam.w == pytest.approx(w, rel=1e-12)
        if text != "0.5mm":
            half = 0.1 / beam.w
            assert np.exp(-2 * half**2) == pytest.approx(0.5, rel=1e-12)
    found = premises(stated("# beam = fwhm:0.2mm:0.4mm\n"))
    assert found.ranges["beam"] == pytest.approx((0.1698643600577, 0.3397287201154))
    assert premises(stated("# beam = TopHat:0.3mm\n")).instrument.beam == TopHat(0.3)


def test_a_beam_that_a_file_states_lies_beside_it(stated, tmp_path, monkeypatch):
    for name in ("beam.csv", other := os.fsdecode(b"beam\xff.csv")):  # the second is no text
        (tmp_path / name).write_text("0, 1\n1, 0\n")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    data = stated("# beam = beam.csv\n")
    for given in ({}, {"beam": f"../{other}"}):
        assert premises(data, options=given).instrument.beam.r[-1] == 1.0
    refused(r"^beam\.csv: expected a file that can be read", premises, data, options={"beam": "beam.csv"})


def test_a_range_is_its_middle_and_its_ends(stated):
    found = premises(stated(""), options={"n": "1.33:1.45", "g": "0.7:0.9"})
    assert (found.setting.n, found.setting.g) == pytest.approx((1.39, 0.8))
    assert found.ranges == {"n": (1.33, 1.45), "g": (0.7, 0.9)}
    assert premises(stated(""), options={"n": "1.4", "g": "0.9"}).ranges == {}
    beamed = premises(stated(""), options={"beam": "0.3:700um"})
    assert (beamed.instrument.beam, beamed.ranges["beam"]) == (Gaussian(0.5), pytest.approx((0.3, 0.7)))
    told = r"g must be a number where a law is fitted, got '0\.1:0\.9'"
    refused(told, premises, stated(""), "hazard", {"g": "0.1:0.9"})


def test_a_simulation_states_its_medium():
    one = read(DATA / "half_space.mco")
    forward = Layer(1.4, 0.1, 10.0, 0.9)
    tissue, outside = (replace(one, medium=Medium((layer,))) for layer in (forward, replace(forward, n=1.5)))
    assert premises(tissue) == Premises(Setting(n=1.4, g=0.9))
    assert premises(outside) == Premises(Setting(n=1.5)), "which no table has"
    assert premises(tissue, "hazard") == Premises(Setting(n=1.4, g=0.9))
    assert premises(tissue, "burley") == Premises(Setting(n=1.4)), "which scatters without direction"
    glass = replace(one, medium=Medium((Layer(1.5, 0.0, 0.0, 1.0, thickness=0.1), forward)))
    assert premises(glass) == premises(glass, "hazard") == Premises(Setting(n=1.4, g=0.9)), "not the glass on top"
    assert known_medium(glass) == known_medium(tissue)
    other = replace(forward, phase=phase.HenyeyGreenstein(0.9))
    assert premises(replace(one, medium=Medium((other,)))).setting in (Setting(n=1.4), Setting(n=1.4, g=0.9))


@pytest.mark.parametrize(
    ("comments", "options", "message"),
    [
        ("# n = 1.4\n# n = 1.5\n", {}, r"own\.csv:2: expected n once, got it again"),
        ("# n =\n", {}, r"own\.csv:1: expected a value of n, got none"),
        ("# n = water\n", {}, r"csv:1: n must be a refractive index > 0, or a range such as 1.33:1.45, got 'water'"),
        (f"#\n# n = {'9' * 5000}\n", {}, r"own\.csv:2: n must be a refractive index > 0, .*, got '9{59}\.\.\."),
        (f"# g: {'9' * 5000}\n", {}, r"own\.csv:1: g must be a mean cosine"),
        ("# beam = wide\n", {}, r"own\.csv:1: beam must be a length > 0, .*fwhm:0\.6mm, .*tophat:0\.5mm, .*\.csv file"),
        ("# beam = 1e400 mm\n", {}, r"own\.csv:1: beam must be between 1e-40 and 1e\+40 mm, got '1e400 mm'"),
        ("# beam = 1e-300 mm\n", {}, r"own\.csv:1: beam must be between 1e-40 and 1e\+40 mm, got '1e-300 mm'"),
        (f"# fibre = {'9' * 5000}\n", {}, r"own\.csv:1: fibre must be between 1e-40 and 1e\+40 mm, got '9{59}\.\.\."),
        ("# beam = tophat:0.2mm:0.3mm\n", {}, r"own\.csv:1: beam must be a length > 0"),
        ("", {"g": "1"}, r"g must be a mean cosine in \(-1, 1\), or a range"),
        ("", {"g": "0.1:0.2:0.3"}, r"g must be a mean cosine in \(-1, 1\), or a range"),
        ("", {"n": "nan"}, r"n must be a refractive index"),
        ("", {"light": "sun"}, r"light must be one of searchlight, diffuse, got 'sun'"),
    ],
)
def test_what_is_wrong_is_named(stated, comments, options, message):
    refused(message, lambda: premises(stated(comments), options=options))


PHANTOM = DATA / "phantom.csv"  # alpha .95, l 1.1 mm


@pytest.fixture(scope="module")
def near():
    return read(PHANTOM).within(None, 2.0)


def test_it_is_the_fit_of_its_parts(near):
    law = profilefit.load("hazard")
    parts = fitted(near, FitSpec(law, {"scale": 1.0}, source=origin("hazard", "regenerated", Setting(), fits_folder())))
    result = fit(near, "hazard", walk=False)
    assert (result.fit.values, result.walk) == (parts.values, None)
    assert result.identifiability.all_identified
    assert result.fit.rel is not None, "the law's record was found"
    refused(r"none\.csv", fit, str(DATA / "none.csv"))  # it reads files


def test_what_is_known_goes_in(near):
    assert fit(near, held={"l": 1.1}, walk=False).fit.values["l"] == pytest.approx(1.1, rel=1e-12)
    free = fit(near, held={"A": 0.53}, scale=None, walk=False).fit
    assert (free.values["A"], free.spec.held.keys()) == (pytest.approx(0.53, rel=1e-6), {"A"})
    measured = fit(near, total=Known(0.53, 0.005), scale=Known(1.0, 0.02), walk=False).fit
    assert measured.spec.held == {}
    assert measured.values["alpha"] == pytest.approx(0.95, abs=4 * measured.errors(measured.statistical)["alpha"])


def test_a_simulation_brings_its_own_surface():
    simulated = read(DATA / "half_space.mco")
    oily = replace(simulated, medium=half_space(0.9, n=1.67))
    with pytest.raises(SettingError, match=r"belongs to .* n in \(1, 1.6\].*, got a request for searchlight, n = 1.67"):
        fit(oily, "hazard")
    with pytest.raises(SettingError, match=r"g = 0, and n from 1.33 to 1.45 where.*, got searchlight, n = 0.9"):
        fit(oily, setting=Setting(n=0.9))
    found = fit(oily, setting=Setting(n=1.4), walk=False).fit
    assert found.spec.law.setting.n == 1.4
    assert found.rel == 0, "light solved exactly"
    assert "the file's n is 1.67, fitted as n = 1.4" in found.data.notes


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"held": {"mu_a": 1.0}}, "held must name some of alpha, A, l, got 'mu_a'"),
        ({"held": {"alpha": 0.9, "A": 0.5}}, "held must have one of alpha and A, which say the same, got both"),
        ({"held": {"l": -1.0}}, "held l must be a number > 0, got -1.0"),
        ({"scale": 0.0}, "scale must be a number > 0, got 0.0"),
        ({"law": "hazzard"}, "law must be one of exact, liang, burley.*, got 'hazzard'"),
        ({"constants": "published"}, "constants must be left out where light is solved exactly, got 'published'"),
    ],
)
def test_what_cannot_be_asked_is_named(near, given, message):
    refused(message, fit, near, **given)
