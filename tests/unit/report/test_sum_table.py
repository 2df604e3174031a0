"""Tables and the figure of sums of Gaussians say what their records say; published ones stand beside those of skin."""

import shutil
from collections import Counter
from dataclasses import replace
from html import escape
from pathlib import Path

import matplotlib
import numpy as np
import pytest

from mcml_sim.media.setting import ILLUMINATIONS
from profilefit.recipes import record
from profilefit.recipes.folder import STACKS, SUMS, fits_folder
from profilefit.recipes.stack.gaussians import constant_names
from profilefit.report.figures.record_figures import sum_caption, sum_figure, sums_of
from profilefit.report.kinds import published, sum_sections, sum_tables
from profilefit.report.page.sections import EvidenceFolder, layers
from profilefit.report.records import Source, largest_error
from profilefit.scenes.skin.law import D_EON
from tests.unit.report.test_tables import rendered

GUIDE = Path(__file__).resolve().parents[3] / "docs" / "guide" / "layered.md"
FOUND = sums_of(fits_folder())


def rows(found, table):
    """Of one of the tables: the cells of every line below its headers, up to the caption."""
    return [line.split() for line in rendered([sum_tables(found)[table]], 400).splitlines()[2:-1]]


@pytest.mark.parametrize("name", FOUND)
def test_a_narrow_screen_loses_and_breaks_nothing(name):
    parts = sum_tables(FOUND[name])
    narrow = rendered(parts, 80)
    assert max(map(len, narrow.splitlines())) <= 80
    assert Counter(narrow.split()) == Counter(rendered(parts, 400).split())


@pytest.mark.parametrize("name", FOUND)
def test_errors_over_their_number(name):
    shown = [row for row in rows(FOUND[name], 0) if row[1] != "published"]
    assert [row[:2] for row in shown] == [[light, str(count)] for light in ILLUMINATIONS for count in range(1, 9)]
    for light, count, *cells in shown:
        one = FOUND[name].content["sums"][light]["by_count"][int(count) - 1]
        known = [*one["rel"], *(max(one[key]) for key in ("rms", "ks", "alone"))]
        assert list(map(float, cells)) == pytest.approx(known, rel=0.05)


def test_six_constants_with_their_errors():
    found = FOUND["heart"]
    shown = rows(found, 1)[: 4 * 6]
    names = [row[0] for row in shown]
    assert names == constant_names(6)
    for name, *cells in shown:
        one = found.content["constants"][f"diffuse.6.{name}"]
        value, *errors = (float(cell) for cell in cells if cell != "[mm^2]")
        assert abs(value - one["regenerated"]) <= max(0.05 * largest_error(one), 0.005 * one["regenerated"])
        keys = ("discretisation_error", "model_error", "misfit_error", "jackknife_error")
        assert errors == pytest.approx([one[key] for key in keys], rel=0.05)
    text = rendered(sum_tables(found), 400)
    assert found.content["note"] in " ".join(text.split())
    assert "noise of the simulation" not in text
    # What least squares holds at 0 has no errors, and is told so.
    held = {name: one for name, one in FOUND["marble-on-potato"].content["constants"].items() if not one["free"]}
    assert "diffuse.6.blue.w6" in held
    (row,) = [row for row in rows(FOUND["marble-on-potato"], 1) if row[0] == "blue.w6"]
    assert row[1:] == ["0.00", "–", "–", "–", "–"]


def test_the_published_gaussians_stand_beside_those_of_skin():
    """Their errors by their own profile, integrated over the rings of skin's light."""
    found = FOUND["skin"]
    of = published(found)
    for light in ILLUMINATIONS:
        for channel, one in enumerate(found.lights(light)):
            fine = np.linspace(one.edges[:-1], one.edges[1:], 33)  # (33, n)
            inside = 2.0 * np.pi * fine * D_EON.profile(fine)[..., channel]
            own = np.trapezoid(inside, fine, axis=0)
            rel = np.mean(np.abs(own * one.whole / one.energy - 1.0))
            assert of[light][channel]["rel"] == pytest.approx(rel, rel=1e-3)
            # Six fitted ones are nearer, in all that is measured.
            six = found.content["sums"][light]["by_count"][5]
            assert all(of[light][channel][key] > 2.0 * six[key][channel] for key in ("rel", "rms", "ks"))
    (row,) = [row for row in rows(found, 0) if row[:2] == ["diffuse", "published"]]
    assert list(map(float, row[2:5])) == pytest.approx([one["rel"] for one in of["diffuse"]], rel=0.05)
    assert "d'Eon" in rendered(sum_tables(found), 80)
    for other in (FOUND["heart"], replace(found, stack=replace(found.stack, unit="cm"))):
        assert published(other) == {}
        assert "d'Eon" not in rendered(sum_tables(other)[:1], 80)


def test_the_caption_has_the_numbers_of_the_records():
    text = sum_caption(FOUND)
    six = {name: one.content["sums"][light]["by_count"][5] for name, one in FOUND.items() for light in ILLUMINATIONS}
    every = [one.content["sums"][light]["by_count"][5] for one in FOUND.values() for light in ILLUMINATIONS]
    assert len(every) == 2 * len(six)
    least, most = min(min(one["rel"]) for one in every), max(max(one["rel"]) for one in every)
    alone = max(max(one["alone"]) for one in every)
    for value in (least, most, alone, *(one["rel"] for one in published(FOUND["skin"])["diffuse"])):
        assert f"{100 * value:.3g} %" in text
    assert "(worst: skin, red, searchlight)" in text
    heart = sum_caption({"heart": FOUND["heart"]})
    assert "published" not in heart
    assert f"{100 * most:.3g} %" not in heart


@pytest.mark.slow
def test_the_figure_is_whole(tmp_path):
    files = sum_figure(Source(fits_folder()), tmp_path)
    assert [file.name for file in files] == ["gaussians-of-stacks.png", "gaussians-of-stacks.svg"]
    pixels = matplotlib.image.imread(files[0])[..., :3]
    assert pixels.shape[1] == 1200
    edges = np.concatenate([pixels[0], pixels[-1], pixels[:, 0], pixels[:, -1]])
    assert np.all(edges > 0.99)
    svg = files[1].read_text(encoding="utf-8")
    assert all(f">{name}</text>" in svg for name in FOUND)
    again = sum_figure(Source(fits_folder()), tmp_path / "again")
    assert again[1].read_bytes() == files[1].read_bytes()


def test_the_guide_has_the_numbers_of_the_records():
    """`profilefit report --markdown docs/guide/layered.md` fills its table; the prose below says what it shows."""
    sections = sum_sections(record.available(fits_folder() / SUMS))
    text = GUIDE.read_text(encoding="utf-8")
    assert f"<!-- stack-gaussians -->\n{sections['stack-gaussians']()}\n<!-- /stack-gaussians -->" in text
    assert sum_sections({}) == {}
    worst = np.array(
        [
            [max(n["rel"]) for n in one.content["sums"][light]["by_count"]]
            for one in FOUND.values()
            for light in ILLUMINATIONS
        ]
    )
    off = 1.0 - (worst[:, -1] / worst[:, 0]) ** (1 / 7)
    assert 0.295 < off.min() < off.max() < 0.405
    assert "takes 30 to 40 % off" in text
    others = published(FOUND["skin"])
    rel = [one["rel"] for light in ILLUMINATIONS for one in others[light]]
    assert f"by {min(rel):.2f} to {max(rel):.2f}, by the same measure" in text
    for light in ILLUMINATIONS:
        six = FOUND["skin"].content["sums"][light]["by_count"][5]
        assert max(one["ks"] for one in others[light]) / max(six["ks"]) == pytest.approx(3.0, abs=0.2)


def test_the_page_draws_it(tmp_path):
    """Where there are records of sums; without them the stacks stand there alone."""
    text = "\n".join(layers(Source(fits_folder()), EvidenceFolder(tmp_path, fits_folder())))
    assert text.count("<svg") == 1
    assert f"<figcaption>{escape(sum_caption(FOUND))}</figcaption>" in text
    assert all(f"<summary>{name}: the numbers</summary>" in text for name in FOUND)
    shutil.copytree(fits_folder() / STACKS, tmp_path / STACKS)
    bare = "\n".join(layers(Source(tmp_path), EvidenceFolder(tmp_path / "none", tmp_path)))
    assert "skimmilk-on-marble" in bare
    assert "Gaussians" not in bare
    assert sums_of(tmp_path) == {}
