"""Tables of stacks and of sums of Gaussians say what their records say; published sums stand beside those of skin."""

import copy
import shutil
from dataclasses import replace
from html import escape
from pathlib import Path

import numpy as np
import pytest

from mcml_sim.media.setting import ILLUMINATIONS
from profilefit.recipes import record
from profilefit.recipes.folder import STACKS, SUMS, fits_folder
from profilefit.recipes.kinds.stack import interfaces, read
from profilefit.recipes.record import ERRORS
from profilefit.recipes.stack.gaussians import constant_names
from profilefit.report.figures.record_figures import OF_SUMS, plans, sum_caption, sums_of
from profilefit.report.kinds import TABLES, published, stack_tables, sum_tables
from profilefit.report.page.sections import EvidenceFolder, layers
from profilefit.report.records import Source
from profilefit.scenes.skin.law import D_EON
from tests.unit.report.test_figures import require_whole
from tests.unit.report.test_tables import narrow, rendered, rounding

GUIDE = Path(__file__).resolve().parents[3] / "docs/explanation/layers.md"
CONTENTS = {name: read(path) for name, path in record.available(fits_folder() / STACKS).items()}
FOUND = sums_of(fits_folder())


def rows_of(table):
    """The cells of its headers, and of every line below up to the caption."""
    header, *rows = (line.split() for line in rendered([table], 400).splitlines()[1:-1])
    return header, rows


def six_of(found, light):
    """What a record says of six Gaussians in a light."""
    return found.content["sums"][light]["by_count"][5]


@pytest.mark.parametrize("kind", ["stack", "gaussians"])
@pytest.mark.parametrize("name", FOUND)
def test_a_narrow_screen_loses_and_breaks_nothing(kind, name):
    narrow(TABLES[kind].tables(CONTENTS[name], FOUND[name].path), 80)


@pytest.mark.parametrize("name", CONTENTS)
def test_every_constant_has_a_row_with_its_errors(name):
    content = CONTENTS[name]
    header, found = rows_of(stack_tables(content)[2])
    known = [key for key in ERRORS if content["constants"]["red.1.w"][key] is not None]
    assert header == ["channel", "interface", "constant", "regenerated", *(w for k in known for w in ("±", ERRORS[k]))]
    assert sorted(".".join(row[:3]) for row in found) == sorted(content["constants"])
    assert [row[0] for row in found] == sorted((row[0] for row in found), key=["red", "green", "blue"].index)
    for channel, number, constant, value, *errors in found:
        one = content["constants"][f"{channel}.{number}.{constant}"]
        assert abs(float(value) - one["regenerated"]) <= rounding(one)
        assert list(map(float, errors)) == pytest.approx([one[key] for key in known], rel=0.05)


@pytest.mark.parametrize("name", CONTENTS)
def test_errors_at_each_thickness_and_the_worst(name):
    content = CONTENTS[name]
    _, (*found, worst) = rows_of(stack_tables(content)[1])
    shown = iter(found)
    for channel, number in interfaces(content):
        quality = content["interfaces"][channel]["quality"][number - 1]
        for d, *values in zip(*(quality[key] for key in ("thickness", "rel", "ks", "delta_A")), strict=True):
            at, of, thickness, unit, *cells = next(shown)
            assert (at, of, unit) == (channel, str(number), content["unit"])
            assert float(thickness) == pytest.approx(d, rel=0.005)
            assert list(map(float, cells)) == pytest.approx(values, rel=0.05)
    assert next(shown, None) is None
    assert worst[0] == "worst"
    rel, ks, of_a = (max(abs(float(row[column])) for row in found) for column in (4, 5, 6))
    assert list(map(float, worst[1:])) == [rel, ks, of_a]


def test_layers_and_fits_are_shown():
    content = CONTENTS["skin"]
    layers = rendered([stack_tables(content)[0]], 100).splitlines()
    assert len(layers) == 2 + 3
    assert layers[2].split() == ["epidermis", "0.25", "mm", "1.4", "0", "0.21", "0.21", "0.5", "4.8", "6", "6.5"]
    assert "infinite" in layers[4]
    _, fits = rows_of(stack_tables(content)[3])
    for (channel, number), row in zip(interfaces(content), fits, strict=True):
        one = content["interfaces"][channel]
        assert row[:2] == [channel, str(number)]
        assert one["fit"][number - 1]["result"] in " ".join(row)
        starts = one["starts"][number - 1]
        assert row[-3:] == [str(starts["as_good"]), "of", str(starts["count"])]


def test_errors_that_do_not_apply_have_no_column():
    """Exact light has no photons, traced light no nodes."""
    content = copy.deepcopy(CONTENTS["heart"])
    assert rows_of(stack_tables(content)[2])[0][4:] == ["±", "dr", "±", "misfit", "±", "jackknife"]
    for one in content["constants"].values():
        one["statistical_error"], one["discretisation_error"] = 1e-3, None
    assert rows_of(stack_tables(content)[2])[0][4:] == ["±", "photons", "±", "misfit", "±", "jackknife"]
    text = rendered(stack_tables(content), 400)
    assert "photons: photon noise" in text
    assert "nodes" not in text


@pytest.mark.parametrize("name", FOUND)
def test_errors_over_their_number(name):
    shown = [row for row in rows_of(sum_tables(FOUND[name])[0])[1] if row[1] != "published"]
    assert [row[:2] for row in shown] == [[light, str(count)] for light in ILLUMINATIONS for count in range(1, 9)]
    for light, count, *cells in shown:
        one = FOUND[name].content["sums"][light]["by_count"][int(count) - 1]
        known = [*one["rel"], *(max(one[key]) for key in ("rms", "ks", "alone"))]
        assert list(map(float, cells)) == pytest.approx(known, rel=0.05)


def test_six_constants_with_their_errors():
    found = FOUND["heart"]
    shown = rows_of(sum_tables(found)[1])[1][: 4 * 6]
    assert [row[0] for row in shown] == constant_names(6)
    for name, *cells in shown:
        one = found.content["constants"][f"diffuse.6.{name}"]
        value, *errors = (float(cell) for cell in cells if cell != "[mm^2]")
        assert abs(value - one["regenerated"]) <= rounding(one)
        keys = (f"{of}_error" for of in ("discretisation", "model", "misfit", "jackknife"))
        assert errors == pytest.approx([one[key] for key in keys], rel=0.05)
    text = rendered(sum_tables(found), 400)
    assert found.content["note"] in " ".join(text.split())
    assert "noise of the simulation" not in text
    # What least squares holds at 0 has no errors, and is told so.
    held = {name: one for name, one in FOUND["marble-on-potato"].content["constants"].items() if not one["free"]}
    assert "diffuse.6.blue.w6" in held
    (row,) = [row for row in rows_of(sum_tables(FOUND["marble-on-potato"])[1])[1] if row[0] == "blue.w6"]
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
            six = six_of(found, light)
            assert all(of[light][channel][key] > 2.0 * six[key][channel] for key in ("rel", "rms", "ks"))
    (row,) = [row for row in rows_of(sum_tables(found)[0])[1] if row[:2] == ["diffuse", "published"]]
    assert list(map(float, row[2:5])) == pytest.approx([one["rel"] for one in of["diffuse"]], rel=0.05)
    assert "d'Eon" in rendered(sum_tables(found), 80)
    for other in (FOUND["heart"], replace(found, stack=replace(found.stack, unit="cm"))):
        assert published(other) == {}
        assert "d'Eon" not in rendered(sum_tables(other)[:1], 80)


def test_the_caption_has_the_numbers_of_the_records():
    text = sum_caption(FOUND)
    every = [six_of(one, light) for one in FOUND.values() for light in ILLUMINATIONS]
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
    source = Source(fits_folder())
    (plan,) = (plan for plan in plans(source) if plan.name == OF_SUMS)
    files = plan.drawn(source, tmp_path)
    assert [file.name for file in files] == ["gaussians-of-stacks.png", "gaussians-of-stacks.svg"]
    require_whole(files)
    svg = files[1].read_text(encoding="utf-8")
    assert all(f">{name}</text>" in svg for name in FOUND)
    again = plan.drawn(source, tmp_path / "again")
    assert again[1].read_bytes() == files[1].read_bytes()


def test_the_guide_has_the_numbers_of_the_records():
    """`profilefit report --markdown docs/explanation/layers.md` fills its table; the prose below says what it shows."""
    sections = TABLES["gaussians"].sections(record.available(fits_folder() / SUMS), fits_folder())
    text = GUIDE.read_text(encoding="utf-8")
    assert f"<!-- stack-gaussians -->\n{sections['stack-gaussians']()}\n<!-- /stack-gaussians -->" in text
    assert TABLES["gaussians"].sections({}, fits_folder()) == {}
    sums = [one.content["sums"][light]["by_count"] for one in FOUND.values() for light in ILLUMINATIONS]
    off = 1.0 - np.array([max(last["rel"]) / max(first["rel"]) for first, *_, last in sums]) ** (1 / 7)
    assert 0.295 < off.min() < off.max() < 0.405
    assert "takes 30 to 40 % off" in " ".join(text.split())
    others = published(FOUND["skin"])
    rel = [100 * one["rel"] for light in ILLUMINATIONS for one in others[light]]
    assert f"error of {min(rel):.0f} % to {max(rel):.0f} % for this skin" in " ".join(text.split())


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
