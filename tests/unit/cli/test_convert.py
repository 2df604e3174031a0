"""`profilefit convert` as a user meets it: what it prints, what it refuses, and in how many lines."""

import json
from functools import partial

import numpy as np
import pytest

from profilefit.convert import BY_NAME, ENGINES, Optical, alpha_of


@pytest.fixture
def command(command):
    return partial(command, "convert")


@pytest.fixture
def table(done):
    """What --json says."""
    return lambda *words: json.loads(done(*words, "--json", said=None))


def test_tables_of_the_medium_and_of_what_to_type(done):
    out = done("--reflectance", "0.9,0.7,1", "--illumination", "diffuse", "--mfp", "1.2mm")
    lines = out.splitlines()
    assert max(map(len, lines)) <= 120
    assert "…" not in out
    row = {line[:38].strip(): line[38:].split() for line in lines}
    assert row["Blender 5.2-5.3 Random Walk"][:8] == ["0.9000", "0.6998", "1.0000", *3 * ["0.001200"], "m", "at"]
    assert row["Blender 3.0-5.3 Christensen-Burley"][3:6] == ["0.01457", "0.01221", "0.01450"]
    assert row["Unity HDRP to 17.2 rasteriser"][-3:] == ["mm", "at", "1"]
    assert row["Unreal 5.1-5.8 rasteriser"][3:] == [*3 * ["0.07200"], "cm", "at", "0.1"]
    assert row["Arnold 5 to 7 standard_surface"] == ["–", *3 * ["1.200"], "mm", "scene"]
    assert {engine.title for engine in ENGINES} <= set(row)
    assert "none: without absorption (alpha = 1)" in out
    assert "index-matched  " not in out.replace("exact, index-matched", ""), "said once"
    assert "–: no source says" in out
    assert "checked:" not in out


def test_sources_of_every_row(command):
    _, out, _ = command("--alpha", "0.5", "--mfp", "1", "--sources")
    text = " ".join(out.split())
    for engine in ENGINES:
        assert f"typed: {engine.formula}" in text
        assert f"source: {engine.source} checked: {engine.checked}" in text
    assert "Mean Free Path Color x Mean Free Path Distance; World Unit Scale = 0.1" in text
    out = command("--alpha", "0.5", "--mfp", "1")[1]
    assert "none" not in out, "what every channel has is not explained away"
    assert "1/length" in out
    assert "No unit was given" in out


def test_json_has_every_convention_and_null_for_none(table):
    printed = table("--alpha", "0.5,1", "--mfp", "2cm")
    colours = {"alpha", "alpha_unreduced", "n", "g", "mu_a", "mu_s", "mu_s_unreduced"}
    colours |= {f"{kind}_{light}" for kind in ("reflectance", "matched") for light in ("searchlight", "diffuse")}
    assert set(BY_NAME) | {"unit", "typed"} | colours == set(printed)
    assert (printed["unit"], printed["mfp"], printed["mu_a"]) == ("cm", [2.0, 2.0], [0.25, 0.0])
    assert printed["dmfp"][1] is None
    assert printed["dmfp"][0] == pytest.approx(2.0)  # sqrt(1.5 / 1.5) l
    assert table("--alpha", "0.5", "--mfp", "2")["unit"] is None
    typed = {row["name"]: row for row in printed["typed"]}
    assert list(typed) == [engine.name for engine in ENGINES]
    assert (typed["hdrp"]["unit"], typed["hdrp"]["scale_field"], typed["hdrp"]["scale"]) == ("mm", "World Scale", 1.0)
    assert typed["hdrp"]["length"] == pytest.approx([10 * x for x in printed["hdrp_distance"]], rel=1e-12)
    assert (typed["mitsuba"]["unit"], typed["mitsuba"]["length"]) == ("1/cm", [0.5, 0.5])
    assert typed["arnold"]["colour"] is None


def test_a_colour_of_a_surface_that_refracts_and_the_matched_one(table, command, refused):
    words = ("--reflectance", "0.8", "--illumination", "diffuse", "--mfp", "1.2mm")
    printed = table(*words, "--n", "1.4")
    assert printed["alpha"] == pytest.approx(alpha_of([0.8], "diffuse", 1.4), rel=1e-12)
    assert printed["reflectance_diffuse"] == pytest.approx([0.8], rel=1e-10)
    matched = table("--alpha", repr(printed["alpha"][0]), "--mfp", "1.2mm")
    same = set(BY_NAME) | {"unit", "mu_a", "mu_s", "matched_diffuse", "matched_searchlight"}  # whatever lies on it
    assert {key: printed[key] for key in same} == {key: matched[key] for key in same}
    assert printed["matched_diffuse"] == matched["reflectance_diffuse"]
    typed = {row["name"]: row["colour"] for row in printed["typed"]}
    assert typed["hdrp"] == printed["matched_diffuse"], "engines that blur assume a matched surface"
    assert printed["alpha"][0] - table(*words)["alpha"][0] > 0.005  # the same colour is another medium
    out = command(*words, "--n", "1.4")[1]
    assert "exact, n = 1.4" in out
    assert out.count("  index-matched") == 2
    for n, why in (("0.9", "n >= 1"), ("nan", "n must be a refractive index"), ("1.4", "must be in [0, 0.923")):
        refused(("--reflectance", "0.99", *words[2:], "--n", n), why)


def test_g_leaves_what_is_reduced_and_changes_the_rest(table, command, refused):
    words = ("--alpha", "0.9", "--mfp", "1mm")
    isotropic, printed = table(*words), table(*words, "--g", "0.8")
    for name in ("alpha", "mfp", "mu_a", "mu_s", "dmfp", "falloff_diffuse", "reflectance_diffuse", "hdrp_distance"):
        assert printed[name] == isotropic[name]
    assert printed["mu_s_unreduced"] == pytest.approx([4.5])
    assert printed["alpha_unreduced"] == pytest.approx([4.5 / 4.6])
    assert printed["mfp_unreduced"] == printed["cycles_radius"] == pytest.approx([1 / 4.6])
    assert "similarity" in command(*words, "--g", "0.8")[1]
    assert "exact, n = 1.4, g = 0.8" in command(*words, "--g", "0.8", "--n", "1.4")[1]
    assert "no such g" in command(*words, "--g", "0.95")[1]
    for g, n, why in (("1", "1", "--g must be a mean cosine in (-1, 1), got 1"), (".8", "2", "n from 1.33 to 1.45")):
        refused((*words, "--g", g, "--n", n), why)


@pytest.mark.parametrize("name", list(BY_NAME))
def test_every_length_is_an_option(table, name):
    """The falloffs share one, whose light --illumination says."""
    light = name.removeprefix("falloff_")
    option = "falloff" if light in ("searchlight", "diffuse") else name.replace("_", "-")
    more = ("--illumination", light) if option == "falloff" else ()
    found = table("--alpha", "0.5,0.9", f"--{option}", "0.3um", *more)
    assert found[name] == pytest.approx([0.3, 0.3], rel=1e-12)
    np.testing.assert_allclose(found["mfp"], Optical.from_length(name, 0.3, [0.5, 0.9]).mfp, rtol=1e-14)
    if light == "searchlight":  # unless said
        assert table("--alpha", "0.5,0.9", "--falloff", "0.3um") == found


def test_coefficients_are_a_colour_and_a_length(table):
    found = table("--mu-a", "0.032,0.17,0.48/mm", "--mu-s", "0.74/mm,0.88/mm,1.01/mm")
    np.testing.assert_allclose(found["mu_s"], [0.74, 0.88, 1.01], rtol=1e-14)
    assert (found["unit"], found["mfp"][0]) == ("mm", pytest.approx(1 / 0.772, rel=1e-14))


def test_the_light_of_a_colour_matters(table):
    words = ("--reflectance", "0.5", "--mfp", "1", "--illumination")
    found = [table(*words, light)["alpha"][0] for light in ("searchlight", "diffuse")]
    np.testing.assert_allclose(found, [alpha_of(0.5, "searchlight"), alpha_of(0.5, "diffuse")], rtol=1e-14)
    assert found[0] - found[1] > 0.02
