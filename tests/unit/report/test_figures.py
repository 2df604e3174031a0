"""Figures are written whole, at the size they are shown, the same twice; what cannot be drawn is listed, and why."""

import json
import shutil

import matplotlib
import matplotlib.image
import matplotlib.pyplot as plt
import numpy as np
import pytest

from profilefit.errors import OutputError, RecordError
from profilefit.fitting.discrepancy import LawWithErrors
from profilefit.recipes import catalogue
from profilefit.report.figures.canvas import only
from profilefit.report.figures.record_figures import PAPER, draw_all, energy_within, plans, residual_figure
from profilefit.report.records import DRAWS, Source, coefficients
from tests.fixtures import refused

pytestmark = pytest.mark.slow

SHIPPED = catalogue.fits_folder()
SMALL_CORNER = "corner-albedo-liang"
# Every kind of figure once: corner plots differ in nothing but their record, nor does (15) from (11) but in its letter.
EACH_KIND = (
    *("liang-7-profile", "liang-11-a", "liang-13-b", "constants", "quality", "quality-liang-whole", SMALL_CORNER),
    *("residuals-albedo-liang", "residuals-burley-whole", "residuals-quantile"),
)
DEAR = ("liang-7-error", "liang-8-albedo", "liang-19-inverse", "inversion-error")
# Cheap ones of each layout, drawn again.
AGAIN = ("liang-11-a", "quality", SMALL_CORNER)


@pytest.fixture(scope="module")
def source():
    return Source(SHIPPED)


@pytest.fixture(scope="module")
def drawn(source, tmp_path_factory):
    """Every kind of figure, drawn once; and what matplotlib's settings were before and after."""
    out = tmp_path_factory.mktemp("figures")
    before = dict(matplotlib.rcParams)
    chosen = [plan for plan in plans(source) if plan.name in EACH_KIND]
    files = [file for plan in chosen for file in plan.drawn(source, out)]
    return files, before, dict(matplotlib.rcParams)


def folder_with(tmp_path, *names, edit=lambda content: None):
    """A folder of these records, the content of each changed by `edit`."""
    folder = tmp_path / "records"
    folder.mkdir()
    for name in names:
        content = json.loads((SHIPPED / f"{name}.json").read_text())
        edit(content)
        (folder / f"{name}.json").write_text(json.dumps(content))
        shutil.copy(SHIPPED / f"{name}.npz", folder)
    return folder


def test_every_kind_is_there_as_png_and_svg_and_nothing_else(drawn):
    files, before, after = drawn
    assert {file.name for file in files} == {f"{name}.{kind}" for name in EACH_KIND for kind in ("png", "svg")}
    assert set(files[0].parent.iterdir()) == set(files)  # no temporary file is left
    require_whole(files)
    assert before == after, "matplotlib is as it was"
    assert plt.get_fignums() == []


def test_the_dear_ones_are_whole_too(source, tmp_path):
    assert {*DEAR, *EACH_KIND} >= {plan.name for plan in PAPER if plan.name != "liang-15-c"}
    chosen = [plan for plan in plans(source) if plan.name in DEAR]
    assert len(chosen) == len(DEAR)
    require_whole([file for plan in chosen for file in plan.drawn(source, tmp_path)])


def require_whole(files):
    """A PNG is 1200 pixels wide; text that did not fit would be cut at the edge, and leave ink there."""
    for file in (file for file in files if file.suffix == ".png"):
        pixels = matplotlib.image.imread(file)[..., :3]
        assert pixels.shape[1] == 1200, file.name
        assert 450 <= pixels.shape[0] <= 1700, file.name
        assert 0.01 < np.mean(pixels.min(axis=2) < 0.9) < 0.6, file.name
        edges = np.concatenate([pixels[0], pixels[-1], pixels[:, 0], pixels[:, -1]])
        assert np.all(edges > 0.99), file.name


def test_svg_carries_text_and_no_date_and_is_the_same_twice_and_one_format_may_be_enough(drawn, source, tmp_path):
    first = {file.stem: file.read_bytes() for file in drawn[0] if file.suffix == ".svg"}
    assert not any(b"<dc:date>" in text for text in first.values())
    assert b">gaussians-4</text>" in first["quality"]
    again = {plan.name: plan for plan in plans(source) if plan.name in AGAIN}
    for name, plan in again.items():
        plan.drawn(source, tmp_path)
        assert (tmp_path / f"{name}.svg").read_bytes() == first[name]
    with only("svg"):
        files = again[SMALL_CORNER].drawn(source, tmp_path / "one")
    assert list((tmp_path / "one").iterdir()) == files == [tmp_path / "one" / f"{SMALL_CORNER}.svg"]


def test_a_corner_is_drawn_without_a_jackknife(tmp_path):
    none = {"jackknife_error": None}
    folder = folder_with(tmp_path, "albedo-liang", edit=lambda c: [one.update(none) for one in c["constants"].values()])
    with only("svg"):
        files, _ = draw_all(folder, tmp_path / "out", ["albedo-liang"])
    assert tmp_path / "out" / f"{SMALL_CORNER}.svg" in files


def test_a_corner_of_many_constants_shows_the_most_correlated(source, tmp_path):
    (plan,) = (plan for plan in plans(source) if plan.name == "corner-hazard-refracting")
    with only("svg"):
        (file,) = plan.drawn(source, tmp_path)
    svg, samples = file.read_text(encoding="utf-8"), source.needed("hazard-refracting").arrays["samples_misfit"]
    names = source.content("hazard-refracting")["covariance"]["names"]
    shown = [name for name in names if f">{name}</text>" in svg]
    assert len(shown) == 9
    assert "the 9 of 32 constants" in svg
    joint = np.abs(np.corrcoef(samples.astype(float), rowvar=False)) - np.eye(len(names))
    first, second = np.unravel_index(joint.argmax(), joint.shape)
    assert {names[first], names[second]} <= set(shown)


def test_residuals_of_a_profile_are_those_of_its_rings(source):
    """The slow twin: from the cdf and the reflectance, for a law that conserves energy."""
    fitted = source.needed("burley-whole")
    edges, alpha = fitted.arrays["r_edges"], float(fitted.arrays["alpha"][9])
    energy = np.diff(fitted.law.cdf(edges, alpha)) * float(source.needed("albedo-rational").law.reflectance(alpha))
    np.testing.assert_allclose(np.diff(energy_within(fitted.law, edges, alpha)), energy, atol=1e-6)


@pytest.mark.parametrize("name", ["albedo-rational-forward", "albedo-rational-diffuse-forward"])
def test_residuals_of_a_map_with_g_are_of_reduced_albedos(source, name):
    """Its error is 2.9e-3 at worst."""
    [ax] = residual_figure(name, source).axes
    left = np.asarray(ax.lines[0].get_ydata(), float)
    assert left.size > 20
    assert 1e-4 < np.max(np.abs(left)) < 3e-3


def test_what_cannot_be_drawn_is_listed(tmp_path):
    fit = {"result": "no fit", "steps": 9, "condition_number": 1.0, "residuals": {}}
    folder = folder_with(tmp_path, "burley-whole", edit=lambda content: content.update(posterior={}, fit=fit))
    files, left_out = draw_all(folder, tmp_path / "out")
    assert [file.name for file in files] == ["quality.png", "quality.svg"]
    assert len(left_out) == len(PAPER) + 4
    assert f"liang-7-profile: {folder} has no record liang-as-published" in left_out
    assert f"constants: {folder} has no record of constants that were printed" in left_out
    assert "residuals-burley-whole: the fit failed: no fit" in left_out
    assert "corner-burley-whole: no posterior: no fit" in left_out


def test_names_choose_the_figures_that_show_them(tmp_path):
    folder = folder_with(tmp_path, "burley-whole", "albedo-rational")
    files, left_out = draw_all(folder, tmp_path / "out", ["albedo-rational"])
    assert {file.stem for file in files} == {"residuals-albedo-rational", "corner-albedo-rational"}
    assert left_out == [f"liang-8-albedo: {folder} has no record albedo-liang"]


def test_a_damaged_record_is_an_error_and_no_gap(tmp_path):
    def edit(content):
        for one in content["constants"].values():
            one.pop("regenerated")

    folder = folder_with(tmp_path, "burley-whole", edit=edit)
    with pytest.raises(RecordError, match=r"is damaged: \[constants\.s0\] regenerated must be .*number, got nothing"):
        draw_all(folder, tmp_path / "out")
    shutil.copy(SHIPPED / "burley-whole.json", folder)
    (folder / "burley-whole.npz").unlink()
    refused("samples and curves of this record are missing", draw_all, folder, tmp_path / "out", error=RecordError)


def test_a_folder_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "out").write_text("a file")
    with pytest.raises(OutputError, match=r"cannot write into .*out: "):
        draw_all(folder_with(tmp_path, "burley-whole"), tmp_path / "out")


def test_band_is_the_quantiles_of_laws_evaluated_one_by_one(source):
    """The slow twin: a law for each draw."""
    fitted = next(f for f in map(source.usable, ("liang-whole", "liang-as-published")) if f is not None)

    def c_of(law):
        return coefficients(law, np.array([0.2, 0.9, 0.995]))[2]

    low, high = fitted.band(c_of)
    samples = fitted.arrays["samples_misfit"].astype(float)
    names = tuple(fitted.content["covariance"]["names"])
    some = samples[np.linspace(0, len(samples) - 1, DRAWS).astype(int)]
    one_by_one = [c_of(fitted.law.with_vector(names, list(map(float, draw)))) for draw in some]
    np.testing.assert_allclose((low, high), np.quantile(one_by_one, [0.025, 0.975], axis=0), rtol=1e-12)
    # Negative control: the fit itself lies inside, and the band has a width.
    assert np.all((low < c_of(fitted.law)) & (c_of(fitted.law) < high))


def test_a_failed_fit_has_no_band_and_no_law_to_draw(tmp_path):
    failed = {"result": "no convergence"}
    here = Source(folder_with(tmp_path, "burley-whole", edit=lambda content: content["fit"].update(failed)))
    assert here.usable("burley-whole") is None
    assert here.fitted("burley-whole").band(lambda law: law.cdf(np.array([1.0]), 0.5)) is None
    assert here.fitted("liang-whole") is None
    refused("has no record 'liang-whole'", here.needed, "liang-whole", error=RecordError)


def test_a_record_without_covariance_is_drawn_without_what_rests_on_it(tmp_path):
    source = Source(folder_with(tmp_path, "burley-whole", edit=lambda content: content.pop("covariance")))
    fitted = source.needed("burley-whole")
    assert fitted.band(lambda law: law.cdf(np.array([1.0]), 0.5)) is None
    assert LawWithErrors.of_record(fitted.law, fitted.content, fitted.arrays).discrepancy is None
    reasons = {plan.name: plan.missing for plan in plans(source)}
    assert "no posterior" in reasons["corner-burley-whole"]
    assert reasons["quality-burley-whole"] == ""
