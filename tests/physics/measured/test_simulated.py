"""Simulated profiles: what is left out, what is merged, which errors they get."""

import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest

from mcml_sim import read_mco
from profilefit.errors import InputError
from profilefit.measured.reading import FEWEST_PHOTONS, NARROWEST, merged, read

DATA = Path(__file__).parents[3] / "examples"


def test_rings_are_merged_until_each_holds_enough_photons():
    edges, photons = np.arange(9.0), np.array([500, 400, 60, 60, 0, 99, 2, 0])
    np.testing.assert_array_equal(merged(edges, photons), [0, 1, 2, 4])
    np.testing.assert_array_equal(merged(edges, np.zeros(8)), [])
    fine = np.linspace(0, 1, 1001)
    starts = merged(fine, np.full(1000, 1e6))
    outer = np.append(fine[starts[1:]], 1.0)
    assert np.all(outer - fine[starts] > 0.999 * NARROWEST * outer)
    assert starts.size < 200


def test_an_mco_has_bounds_for_errors_and_no_last_ring():
    found, raw = read(DATA / "half_space.mco"), read_mco(DATA / "half_space.mco")
    assert (found.unit, found.counted, found.bounded, found.rings) == ("cm", True, True, True)
    assert found.outer[-1] == pytest.approx(raw.run.grid.r_edges[-2])
    areas = np.pi * (found.outer**2 - found.inner**2)
    energy = (raw.reflectance_r * raw.run.grid.r_areas)[:-1].sum()
    assert np.sum(found.value * areas) == pytest.approx(energy), "no light is lost where rings are merged"
    counts = found.value * areas * raw.run.photons
    assert counts.min() > FEWEST_PHOTONS
    photons = raw.run.photons
    assert found.photons == photons
    np.testing.assert_allclose((found.sigma / found.value) ** 2, 1 / counts - 1 / (photons - 1))
    assert found.notes[0] == "the last of 120 annuli, which holds all light beyond it, is left out"
    assert "119 annuli merged into" in found.notes[1]


def test_an_npz_has_its_own_errors_and_keeps_every_ring():
    """The same run as the .mco."""
    exact, bound = read(DATA / "half_space.npz"), read(DATA / "half_space.mco")
    assert (exact.counted, exact.bounded) == (True, False)
    assert exact.outer[-1] == pytest.approx(1.2)
    assert exact.medium is not None
    assert exact.medium.layers[0].mu_s == 9.0
    assert exact.photons == bound.photons
    same = slice(0, 30)  # not merged yet
    np.testing.assert_allclose(exact.value[same], bound.value[same], rtol=1e-4)
    assert np.all(exact.sigma[same] < bound.sigma[same]), "a bound is one"
    assert exact.inner.size < 120, "the empty tail belongs to the last ring"
    with pytest.raises(InputError, match=r"^unit must be cm or left out for .npz, whose lengths are in cm, got 'mm'"):
        read(DATA / "half_space.npz", unit="mm")


def test_files_with_too_little_light(tmp_path):
    text = (DATA / "half_space.mco").read_text()
    (tmp_path / "few.mco").write_text(text.replace("2097152 \t", "50 \t"))
    with pytest.raises(InputError, match=r"few.mco: expected at least 3 annuli .*, got \d\d in"):
        read(tmp_path / "few.mco")
    head, _, rest = text.partition("\nRd_r #")
    first = rest.split("\n")[1]
    (tmp_path / "bright.mco").write_text(head + "\nRd_r #" + rest.replace(first, "1E+20", 1))
    with pytest.raises(InputError, match=r"bright.mco: expected annuli of reflectance >= 0 that add up to at most 1"):
        read(tmp_path / "bright.mco")
    (tmp_path / "bad.npz").write_bytes(b"PK")
    with pytest.raises(InputError, match=r"bad.npz: expected results of mcml_sim, got: not a whole .npz file"):
        read(tmp_path / "bad.npz")


def test_light_that_no_run_gives_is_one_line(tmp_path):
    text = (DATA / "half_space.mco").read_text()
    (tmp_path / "mirror.mco").write_text(re.sub(r"0\s*\t#Specular", "1 \t#Specular", text))
    with pytest.raises(InputError, match=r"mirror.mco: expected a specular reflectance below 1, got 1$"):
        read(tmp_path / "mirror.mco")
    with np.load(DATA / "half_space.npz") as whole:
        arrays = dict(whole)

    def changed(name, times):
        np.savez(tmp_path / "bad.npz", **{**arrays, name: arrays[name] * times})
        return tmp_path / "bad.npz"

    for name, times, message in (
        ("reflectance_r", 1e300, "expected annuli of reflectance >= 0 that add up to at most 1"),
        ("reflectance_r", -1, "expected annuli of reflectance >= 0"),
        ("reflectance_r_standard_error", 1e300, "expected standard errors of no more than all of the light"),
        ("reflectance_r_standard_error", 0, r"expected a standard error > 0 of the light from r = [\d.]+ to [\d.]+$"),
    ):
        with pytest.raises(InputError, match=f"bad.npz: {message}"):
            read(changed(name, times))
    header = json.loads(str(arrays["header"])) | {"photons": 1}
    np.savez(tmp_path / "bad.npz", **{**arrays, "header": np.array(json.dumps(header))})
    with pytest.raises(InputError, match=r"bad.npz: expected two photons or more, .*, got 1"):
        read(tmp_path / "bad.npz")
    assert read(changed("reflectance_r", 1)).photons > 2


def test_rows_can_be_chosen():
    data = read(DATA / "phantom.csv")
    near = data.within(None, 1.0)
    assert near.r.max() <= 1.0
    assert near.notes == ("12 of 20 rows left out, by `r_min` and `r_max`",)
    assert data.within(0.1, 100.0) is data
    with pytest.raises(InputError, match=r"no row is left between `r_min` and `r_max`: r goes from 0.2 to 12"):
        data.within(20.0, None)
    assert dataclasses.replace(data, unit="m").relative_error == pytest.approx(0.02, rel=0.1)
