"""Records of sums of Gaussians: read as the laws that were written, refused in one line, and what those shipped say."""

from itertools import product

import numpy as np
import pytest

from mcml_sim import Setting
from mcml_sim.media.setting import ILLUMINATIONS
from profilefit.errors import InputError, RecordError
from profilefit.materials import CHANNELS
from profilefit.recipes import record
from profilefit.recipes.folder import SUMS, fits_folder
from profilefit.recipes.kinds import gaussians as sums
from profilefit.recipes.kinds.gaussians import COUNTS, find, load, request
from profilefit.recipes.record import ERRORS
from profilefit.recipes.stack.gaussians import constant_names
from tests.fixtures import recorded
from tests.unit.recipes.stack.test_record import GONE, RUN, SHIPPED, STACK, refused_record, spoil

EDGES = np.geomspace(0.01, 10.0, 6)


def made_sums(media, illumination, tracing=None):
    """What `_of_light` gives after a minute, at once; each light, number, colour and Gaussian has its own."""
    shift = 1.0 + ILLUMINATIONS.index(illumination)
    constants, by_count = {}, []
    for count in COUNTS:
        weights = np.arange(1.0, count + 1)[::-1] ** np.array([[1.0], [2.0], [0.0]])
        values = [*(shift * 0.1 * 3.0 ** np.arange(count)), *(weights / weights.sum(axis=1, keepdims=True)).ravel()]
        errors = dict.fromkeys(ERRORS, 1e-3) | {"statistical_error": None}
        for name, value in zip(constant_names(count), values, strict=True):
            constants[f"{count}.{name}"] = {"published": None, "regenerated": value, "free": True, **errors}
        measured = {key: [place / count for place in (0.1, 0.2, 0.3)] for key in sums.MEASURED}
        by_count.append({"result": "converged", "steps": 9, "condition_number": 3.0, **measured})
    whole = [0.5, 0.4, 0.3][: len(media)]
    arrays = {}
    for channel, a in zip(CHANNELS, whole, strict=True):
        light = EDGES * shift, np.full(5, 0.05) * a, np.full(5, 5**-0.5), np.zeros(5), np.array([a, 0.02])
        arrays |= {f"{channel}_{key}": value for key, value in zip(sums.ARRAYS, light, strict=True)}
    return {"constants": constants, "reflectance": whole, "share": [0.25] * 3, "by_count": by_count, "arrays": arrays}


@pytest.fixture
def written(monkeypatch, tmp_path):
    """The record of a stack whose fit takes no time."""
    monkeypatch.setattr(sums, "_of_light", made_sums)
    (tmp_path / "heart.toml").write_text(STACK, encoding="utf-8")
    return recorded(sums.fit(request(str(tmp_path / "heart.toml")), RUN), tmp_path / "mine")


def test_a_record_is_read_as_the_sums_that_were_written(written, tmp_path):
    assert written == tmp_path / "mine" / "gaussians" / "heart.json"
    found, of = load(written), request(str(tmp_path / "heart.toml"))
    assert found.stack.media == of.stack.media
    for light, count in product(ILLUMINATIONS, COUNTS):
        known = made_sums(of.stack.media, light)
        values = {name: one["regenerated"] for name, one in known["constants"].items()}
        for place, (channel, law) in enumerate(zip(CHANNELS, found.laws(light, count), strict=True)):
            assert (law.setting, law.total_reflectance) == (Setting(light, n=1.38), known["reflectance"][place])
            unit = of.stack.media[place].layers[0].mfp
            variance = [values[f"{count}.v{i + 1}"] / unit**2 for i in range(count)]
            weight = [values[f"{count}.{channel}.w{i + 1}"] for i in range(count)]
            np.testing.assert_allclose(law.variance, variance, rtol=1e-11)
            np.testing.assert_allclose(law.weight, weight, rtol=1e-11)
        for channel, one in zip(CHANNELS, found.lights(light), strict=True):
            np.testing.assert_array_equal(one.edges, known["arrays"][f"{channel}_edges"])
            assert [one.whole, one.inside] == known["arrays"][f"{channel}_ends"].tolist()
    first, second = (found.laws(light)[0].variance for light in ILLUMINATIONS)
    assert first != second
    again = recorded(sums.fit(of, RUN), tmp_path / "again")
    for ending in (".json", ".npz"):
        assert again.with_suffix(ending).read_bytes() == written.with_suffix(ending).read_bytes()
    assert (find("heart", tmp_path / "mine").path, find("skin", tmp_path / "mine")) == (written, None)


DAMAGE = [
    ("pipeline", "stack", r"must be a record of sums of Gaussians, got pipeline 'stack'"),
    ("sums", GONE, r"table \[sums\] is missing"),
    ("sums/diffuse", GONE, r"table \[sums.diffuse\] is missing"),
    ("sums/diffuse/by_count/7", GONE, r"\[sums.diffuse\] by_count must be 8, one a number of Gaussians, got 7"),
    ("sums/searchlight/by_count/3/rel", "x", r"\[sums.*by_count 4\] rel must be a list of 3 numbers, .*, got 'x'"),
    (
        "sums/searchlight/by_count/3/ks",
        [0.1, 0.2],
        r"\[sums.*by_count 4\] ks must be .*3 numbers, one a colour, got \[0.1, ",
    ),
    ("sums/searchlight/reflectance", [0.5, 0.4, -0.3], r"\[sums.searchlight\] reflectance must be .* in \(0, 1\]"),
    ("constants/diffuse.6.green.w2", GONE, r"\[constants\] diffuse.6.green.w2 must be a table, got nothing"),
    ("constants/diffuse.6.v2/regenerated", 1e-9, r"constants.diffuse.6.v1 and on must rise from above 0"),
    ("constants/diffuse.1.v1/regenerated", -1.0, r"constants.diffuse.1.v1 and on must rise from above 0"),
    ("constants/diffuse.6.red.w2/regenerated", 0.9, r"diffuse.6: weights of a colour must be >= 0 and sum to 1"),
    ("layers", "x", r"layers must be tables \[\[layers\]\], got 'x'"),
    ("layers/1/thickness", 2.0, r"the last layer must be infinitely thick, got 2"),
    ("setting/illumination", "sun", r"it has no valid setting"),
]


@pytest.mark.parametrize(("place", "value", "message"), DAMAGE)
def test_a_damaged_record_is_one_line(written, place, value, message):
    assert load(written)
    spoil(written, place, value)
    refused_record(load, written, message)


SHORT = {"red_energy": np.ones(4), "blue_ends": np.array([0.5]), "green_weight": np.ones((5, 1))}
NO_LIGHT = [("red_edges", None), ("red_edges", EDGES[::-1]), *SHORT.items()]


@pytest.mark.parametrize(("name", "value"), NO_LIGHT)
def test_damaged_arrays_are_one_line(written, name, value):
    file = written.with_suffix(".npz")
    arrays = record.read_arrays(written)
    arrays[f"diffuse_{name}"] = value
    np.savez(file, **{key: one for key, one in arrays.items() if one is not None})
    load(written).lights("searchlight")
    with pytest.raises(RecordError, match=rf"heart\.npz: is damaged: diffuse_{name[: name.index('_')]} is no light"):
        load(written).lights("diffuse")
    file.unlink()
    with pytest.raises(RecordError, match=r"heart\.npz: .* missing; regenerate it"):
        load(written).lights("searchlight")


def test_what_no_sums_are_for_is_refused_before_any_fit(monkeypatch, tmp_path):
    monkeypatch.setattr(sums, "_of_light", lambda *_: pytest.fail("nothing is to be fitted"))
    path = tmp_path / "heart.toml"
    path.write_text(STACK.replace("n = 1.38\nmu_a = [0.20", "n = 1.5\nmu_a = [0.20"), encoding="utf-8")
    with pytest.raises(InputError, match="layers must have one n for a law of a stack"):
        recorded(sums.fit(request(str(path)), RUN), tmp_path / "mine")
    assert not (tmp_path / "mine").exists()


@pytest.fixture(scope="module")
def shipped():
    return {name: load(fits_folder() / SUMS / f"{name}.json") for name in SHIPPED}


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_stack_has_its_sums(shipped, name):
    """Of the layers that its file has; all fits converged, each error there where it applies.

    It is as far from its light as it says, by the laws that it makes, in their own lengths; those of another colour are
    farther.
    """
    found = shipped[name]
    assert record.plain(found.stack.media) == record.plain(request(name).stack.media)
    assert found.content["fit"]["result"] == "converged"
    for place, one in found.content["constants"].items():
        known = {key for key in ERRORS if one[key] is not None}
        assert known == (set(ERRORS) - {"statistical_error"} if one["free"] else set()), place
        assert one["free"] or one["regenerated"] in (0, 1), place
        assert all(one[key] > 0 for key in known), place

    units = [medium.layers[0].mfp for medium in found.stack.media]

    for light, count in product(ILLUMINATIONS, (2, 6)):
        rings, laws = found.lights(light), list(zip(found.laws(light, count), units, strict=True))

        def measured(laws, rings=rings):
            """Measure rel and ks of each colour."""
            for (law, unit), one in zip(laws, rings, strict=True):
                share = np.asarray(law.cdf(one.edges / unit, 0.5), float)
                data = one.inside + np.append(0.0, np.cumsum(one.energy)) / one.whole
                yield np.mean(np.abs(np.diff(share) * one.whole / one.energy - 1.0)), np.max(np.abs(share - data))

        told = found.content["sums"][light]["by_count"][count - 1]
        rel, ks = zip(*measured(laws), strict=True)
        np.testing.assert_allclose(rel, told["rel"], rtol=1e-3)  # float32
        np.testing.assert_allclose(ks, told["ks"], rtol=1e-3)
        assert np.mean([rel for rel, _ in measured([*laws[1:], laws[0]])]) > 1.02 * np.mean(told["rel"])


def test_what_six_cost(shipped):
    """The worst of heart and skin in both lights; variances of their own serve each colour better than shared ones."""
    six = [shipped[name].content["sums"][light]["by_count"][5] for name in ("heart", "skin") for light in ILLUMINATIONS]
    assert 0.15 < max(max(one["alone"]) for one in six) <= 0.16
    assert 0.16 < max(max(one["rel"]) for one in six) < 0.17
    for name, light in product(SHIPPED, ILLUMINATIONS):
        by_count = shipped[name].content["sums"][light]["by_count"]
        rms = np.array([one["rms"] for one in by_count])
        assert np.all(np.diff(np.sum(rms**2, axis=1)) < 0)  # what the fit makes small
        assert all(np.mean(one["alone"]) <= 1.02 * np.mean(one["rel"]) for one in by_count)
