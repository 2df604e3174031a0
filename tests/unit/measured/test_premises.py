"""What a fit takes for granted: as told, else as the file states, else assumed."""

from dataclasses import replace
from pathlib import Path

import pytest

from mcml_sim import Layer, Medium, Setting, phase
from profilefit.errors import InputError
from profilefit.measured import read
from profilefit.measured.beam import Gaussian
from profilefit.measured.premises import Premises, premises

DATA = Path(__file__).parents[3] / "examples"
ROWS = "r [mm],value,sigma\n0.5,0.1,0.01\n1,0.05,0.01\n2,0.01,0.001\n"


@pytest.fixture
def stated(tmp_path):
    def write(comments, rows=ROWS):
        path = tmp_path / "own.csv"
        path.write_text(comments + rows)
        return read(path)

    return write


def test_nothing_told_is_assumed(stated):
    assert premises(stated("# measured by hand\n")) == Premises(Setting(), assumed=("n", "g"))


def test_a_file_states_and_options_go_before_it(stated):
    data = stated("# n = 1.4\n# G: 0.9\n# beam = 0.5mm\n# light=diffuse\n")
    found = premises(data)
    assert found.setting == Setting("diffuse", 1.4, 0.9)
    assert (found.instrument.beam, found.assumed) == (Gaussian(0.5), ())
    assert premises(data, told={"g": "0.8", "beam": None}).setting.g == 0.8
    assert stated("# unit = cm\n", ROWS.replace(" [mm]", "")).unit == "cm"
    assert stated(ROWS.splitlines()[0] + "\n# n = 1.4\n", ROWS.partition("\n")[2]).stated == {}, "above the header only"


def test_a_beam_that_a_file_states_lies_beside_it(stated, tmp_path, monkeypatch):
    (tmp_path / "beam.csv").write_text("0, 1\n1, 0\n")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    data = stated("# beam = beam.csv\n")
    assert premises(data).instrument.beam.r[-1] == 1.0
    with pytest.raises(InputError, match=r"^beam\.csv: expected a file that can be read"):
        premises(data, told={"beam": "beam.csv"})


def test_a_range_is_its_middle_and_its_ends(stated):
    found = premises(stated(""), told={"n": "1.33:1.45", "g": "0.7:0.9"})
    assert (found.setting.n, found.setting.g) == pytest.approx((1.39, 0.8))
    assert found.ranges == {"n": (1.33, 1.45), "g": (0.7, 0.9)}
    assert premises(stated(""), told={"n": "1.4", "g": "0.9"}).ranges == {}
    beamed = premises(stated(""), told={"beam": "0.3:700um"})
    assert beamed.instrument.beam == Gaussian(0.5)
    assert beamed.ranges["beam"] == pytest.approx((0.3, 0.7))


def test_a_simulation_states_its_medium():
    one = read(DATA / "half_space.mco")
    forward = Layer(1.4, 0.1, 10.0, 0.9)
    tissue, outside = (replace(one, medium=Medium((layer,))) for layer in (forward, replace(forward, n=1.5)))
    assert premises(tissue) == Premises(Setting(n=1.4, g=0.9))
    assert premises(outside) == Premises(Setting(n=1.5)), "which no table has"
    assert premises(tissue, "hazard") == Premises(Setting(n=1.4, g=0.9))
    assert premises(tissue, "burley") == Premises(Setting(n=1.4)), "which scatters without direction"
    glass = replace(one, medium=Medium((Layer(1.5, 0.0, 0.0, 1.0, thickness=0.1), forward)))
    assert premises(glass) == premises(glass, "hazard") == Premises(Setting(n=1.5)), "no light scatters in glass"
    other = replace(forward, phase=phase.HenyeyGreenstein(0.9))
    assert premises(replace(one, medium=Medium((other,)))).setting in (Setting(n=1.4), Setting(n=1.4, g=0.9))


@pytest.mark.parametrize(
    ("comments", "told", "message"),
    [
        ("# n = 1.4\n# n = 1.5\n", {}, r"own\.csv:2: expected n once, got it again"),
        ("# n = water\n", {}, r"own\.csv: n must be a refractive index > 0, or a range such as 1.33:1.45, got 'water'"),
        ("# beam = wide\n", {}, r"own\.csv: beam must be a length > 0"),
        ("", {"g": "1"}, r"g must be a mean cosine in \(-1, 1\), or a range"),
        ("", {"g": "0.1:0.2:0.3"}, r"g must be a mean cosine in \(-1, 1\), or a range"),
        ("", {"n": "nan"}, r"n must be a refractive index"),
        ("", {"light": "sun"}, r"light must be one of searchlight, diffuse, got 'sun'"),
    ],
)
def test_what_is_wrong_is_named(stated, comments, told, message):
    with pytest.raises(InputError, match=message):
        premises(stated(comments), told=told)


def test_a_law_takes_no_range(stated):
    with pytest.raises(InputError, match=r"g must be a number where a law is fitted, got '0\.1:0\.9'"):
        premises(stated(""), "hazard", {"g": "0.1:0.9"})
