"""The explorer in a browser, from file://: what it computes by the exported texts is what Python computes.

A page with the explorer in it is made once for all tests.
"""

import json
import re
import shutil

import numpy as np
import pytest

from benchmarks import explorer_tables
from mcml_sim import Setting, exact
from profilefit.fitting.quality import profile_quality
from profilefit.recipes import catalogue
from profilefit.recipes.catalogue import profile_laws
from profilefit.report.explorer import explorer_section
from profilefit.report.explorer.fragment import address, first, offered
from profilefit.scenes.stage.judge import srgb_codes
from profilefit.scenes.stage.reference.step_edge import step_response
from profilefit.shader.law_file import export

pytestmark = pytest.mark.slow

ROUNDING = 1e-5  # relative, of R_d in float32: `profilefit check` finds at most 2.3e-6; this is another float32
TABLE = 2e-5  # of the exact solution between the knots of the explorer's table
REFRACTED = 5e-4, 5e-5  # of R_d and of the cdf from n = 1.1 up, between the knots in n, too
NEAR_ONE = 3e-3, 3e-4  # where n is less
# One law of each kind: the first call of a law in Python takes as long as ten in the browser.
COMPARED = {"hazard-diffuse", "quantile", "burley-published", "liang-corrected", "gaussians-4"}
COMPARED |= {"dipole", "better_dipole"}
REFLECTANCE, MFP = [0.2, 0.6, 0.97], [0.4, 1.0, 2.5]
CURVES = """([light, n, alphas, radii]) => alphas.map((alpha, i) => {
  const curve = explorer.state.tables[light].at(n).curve(alpha);
  return radii[i].map((x) => [curve.profile(x), curve.cdf(x), curve.edge(-x)]);
})"""
NO_WEBGL = "HTMLCanvasElement.prototype.getContext = () => null"
HEAD = '<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
FITS = catalogue.fits_folder()


@pytest.fixture(scope="module")
def fragment():
    return explorer_section(FITS)


@pytest.fixture(scope="module")
def file(fragment, tmp_path_factory):
    """A page with nothing but the explorer: its own colours, its own font size."""
    path = tmp_path_factory.mktemp("explorer") / "page.html"
    path.write_text(f"<!DOCTYPE html>{HEAD}{fragment}")
    return path


@pytest.fixture(scope="module")
def laws():
    return {address(named): named.law for named in profile_laws(FITS)}


@pytest.fixture(scope="module")
def explorer(open_shared_page, file):
    return open_shared_page(file)


def chosen(page, law, n=1.0):
    """What is measured of each channel after a choice of the law: arrays (channels, ...) by name, radii thinned out."""
    told = page.evaluate(
        """([id, A, l, n]) => {
          const { state } = explorer;
          state.refract(n);
          state.choose(state.laws.find((law) => law.id === id));
          [0, 1, 2].forEach((c) => { state.set("reflectance", c, A[c]); state.set("mfp", c, l[c]); });
          explorer.update();
          const some = (values) => values.filter((_, i) => i % 16 === 0);
          return explorer.values.channels.map(({ alpha, mfp, rel, ks, r, profile }) =>
            ({ alpha, mfp, rel, ks, r: some(r), profile: some(profile) }));
        }""",
        [law, REFLECTANCE, MFP, n],
    )
    return {key: np.array([one[key] for one in told]) for key in told[0]}


def pixels(page, part):
    """(columns, 3) 8-bit values of a strip."""
    data = page.evaluate(
        """(part) => {
          const canvas = document.querySelector(`[data-part="${part}"]`);
          return Array.from(canvas.getContext("2d").getImageData(0, 0, canvas.width, 1).data);
        }""",
        part,
    )
    return np.array(data).reshape(-1, 4)[:, :3]


def test_fragment_stands_alone(fragment):
    assert len(fragment.encode()) < 1_500_000
    addresses = set(re.findall(r"https?://[^\s\"'<\\]*", fragment))
    assert addresses <= {"http://www.w3.org/1999/xlink"}
    ids = re.findall(r'\sid="([^"]*)"', fragment)
    assert len(ids) == len(set(ids))


def test_a_slider_moves_pixels_and_curves_to_the_value_of_python(open_page, file, laws):
    explorer = open_page(file, fragment="#explorer?law=dipole")
    explorer.locator("#explorer-A-red").fill("0.3")
    explorer.locator("#explorer-l-red").fill("0.25")
    explorer.wait_for_function("explorer.values.channels[0].mfp > 1.7")
    red = explorer.evaluate("(({ exact, ...one }) => one)(explorer.values.channels[0])")
    mfp, law = red["mfp"], laws["dipole"]
    assert (red["reflectance"], mfp) == (0.3, pytest.approx(10**0.25, rel=1e-5))
    assert red["alpha"] == pytest.approx(catalogue.albedo_law("rational").alpha(0.3), abs=1e-5)
    np.testing.assert_allclose(red["profile"], law.profile(red["r"], red["alpha"], mfp), rtol=ROUNDING)
    np.testing.assert_allclose(red["cdf"], law.cdf(red["r"], red["alpha"], mfp), atol=1e-6)
    x = np.array(explorer.evaluate("explorer.values.x"))
    by_law = 0.3 * step_response(x, red["alpha"], mfp, law=law)
    truth = 0.3 * step_response(x, red["alpha"], mfp)
    for part, expected in (("edge-law", by_law), ("edge-exact", truth)):
        np.testing.assert_allclose(pixels(explorer, part)[:, 0], srgb_codes(expected), atol=0.51)
    assert np.max(np.abs(srgb_codes(by_law) - srgb_codes(truth))) > 5  # so that neither stands in for the other
    assert explorer.locator("#explorer-A-red + output").inner_text() == "0.300"
    assert explorer.locator("#explorer-material").input_value() == ""


def test_keys_move_sliders_and_the_light(open_page, file):
    explorer = open_page(file)
    before = explorer.evaluate("[explorer.state.mfp[1], ...explorer.state.turn]")
    explorer.locator("#explorer-l-green").press("ArrowRight")
    explorer.locator("canvas.ball").press("ArrowUp")
    after = explorer.evaluate("[explorer.state.mfp[1], ...explorer.state.turn]")
    assert after[0] == pytest.approx(before[0] * 10**0.01, rel=0.02)
    assert after[1:] == [before[1], before[2] + 5]
    box = explorer.locator("canvas.ball").bounding_box()
    # Between the middle of the law's ball and its rim: a radius of 0.94 quarters of the width.
    right = {"x": box["width"] * (0.75 + 0.94 / 4 * np.sin(np.radians(30.0))), "y": box["height"] / 2}
    explorer.locator("canvas.ball").click(position=right)
    assert explorer.evaluate("explorer.state.turn") == pytest.approx([30, 0], abs=1)


def test_every_law_runs_as_it_does_in_python(explorer, laws):
    there = explorer.evaluate("explorer.state.laws.map((law) => law.id)")
    assert set(there) == {name for name in laws if name != "beam_diffusion"}
    for name in there:
        found = chosen(explorer, name)
        assert np.all(found["rel"] < 1) or name in ("liang-published", "gaussians-2"), name
        if name not in COMPARED:
            continue
        alpha, mfp = (np.float32(found[key]).astype(float)[:, None] for key in ("alpha", "mfp"))  # as the GPU gets them
        truth = laws[name].profile(found["r"], alpha, mfp)
        seen = truth > 1e-12 * truth.max()  # Gaussians underflow far out
        np.testing.assert_allclose(found["profile"][seen], truth[seen], rtol=ROUNDING, err_msg=name)
    assert explorer.locator("[data-part='fault']").is_hidden()


@pytest.mark.parametrize("name", ["hazard-diffuse", "burley-diffuse"])
def test_errors_are_those_of_quality(explorer, laws, name):
    found = chosen(explorer, name)
    truth = profile_quality(laws[name], found["alpha"])
    np.testing.assert_allclose(found["rel"], truth.rel, atol=TABLE)
    np.testing.assert_allclose(found["ks"], truth.ks, atol=TABLE)
    texts = explorer.locator("[data-part='readout'] td:nth-child(5)").all_inner_texts()
    np.testing.assert_allclose([float(text.replace("−", "-")) for text in texts], truth.rel, rtol=0.05)  # two digits


# Without a surface that refracts; a knot, near the lowest ones where the light changes fastest, and half-way between
# two of the others.
@pytest.mark.parametrize(
    ("n", "white", "nearest", "bounds"),
    [
        (1.0, (0.99999,), 1e-4, (TABLE, TABLE)),
        *((n, (0.99, 0.9999), 1e-3, REFRACTED) for n in (1.4, 1.34, 1.16)),
        (1.04, (0.99, 0.9999), 1e-3, NEAR_ONE),
    ],
    ids=["n1", "n1.4", "n1.34", "n1.16", "n1.04"],
)
@pytest.mark.parametrize("light", ["searchlight", "diffuse"])
def test_table_is_the_exact_half_space(explorer, light, n, white, nearest, bounds):
    alpha, setting = np.array([0.03, 0.5, 0.9, *white, 1.0])[:, None], Setting(light, n)
    x = np.asarray(exact.quantile(0.995, alpha, setting=setting)) * np.geomspace(nearest, 1.0, 20)
    told = explorer.evaluate(CURVES, [light, n, alpha[:, 0].tolist(), x.tolist()])
    profile, cdf, edge = np.moveaxis(np.array(told), -1, 0)
    np.testing.assert_allclose(profile, exact.profile(x, alpha, setting=setting), rtol=bounds[0])
    np.testing.assert_allclose(cdf, exact.cdf(x, alpha, setting=setting), atol=bounds[1])
    if n == 1.0:
        np.testing.assert_allclose(edge[:, ::4], step_response(-x[:, ::4], alpha, setting=setting), atol=TABLE)


@pytest.mark.parametrize("name", ["hazard", "hazard-diffuse"])
def test_hazard_follows_the_index_by_the_text_that_is_exported(explorer, name):
    light = "diffuse" if name.endswith("diffuse") else "searchlight"

    def has_text_of(named):
        return explorer.locator("[data-part='text']").text_content() == export(named, FITS, "glsl-es", "law")

    for n in (1.02, 1.34, 1.6):
        found = chosen(explorer, name, n)
        named = catalogue.find(f"{name}-refracting", FITS, n=n)
        assert has_text_of(named)
        truth = profile_quality(named.law, found["alpha"])
        np.testing.assert_allclose(found["rel"], truth.rel, atol=REFRACTED[0])
        np.testing.assert_allclose(found["ks"], truth.ks, atol=REFRACTED[1])
        assert named.setting == Setting(light, n)
        assert explorer.locator("[data-part='foreign']").is_hidden()
    chosen(explorer, name)
    assert has_text_of(catalogue.find(name, FITS))


def test_a_law_made_for_one_index_says_so_under_another(explorer):
    found = chosen(explorer, "dipole", 1.4)
    assert np.all(found["rel"] > 0.1)
    explorer.evaluate("explorer.controls.show()")
    assert "is of n = 1" in explorer.locator("[data-part='foreign']").inner_text()
    assert explorer.locator("#explorer-law option:checked").inner_text() == "n = 1: dipole"
    chosen(explorer, "dipole")
    assert explorer.locator("[data-part='foreign']").is_hidden()


def test_the_index_is_a_slider_and_part_of_the_address(open_page, file):
    page = open_page(file, fragment="#explorer?law=hazard&n=1.333&material=marble")
    assert page.evaluate("[explorer.state.n, explorer.state.material.name]") == [1.34, "marble"]
    before = page.evaluate("explorer.values.channels.map((one) => [one.alpha, one.reflectance])")
    page.locator("#explorer-n").press("ArrowRight")
    page.wait_for_function("location.hash.includes('n=1.36')")
    assert page.locator("#explorer-n + output").inner_text() == "1.36"
    after = page.evaluate("explorer.values.channels.map((one) => [one.alpha, one.reflectance])")
    for (alpha, bright), (same, darker) in zip(before, after, strict=True):
        assert same == pytest.approx(alpha, abs=1e-6)
        assert darker < bright
    page.locator("#explorer-n").press("End")
    page.wait_for_function("explorer.values.channels[0].reflectance < 0.9 && location.hash.includes('n=1.6&')")


def test_the_picture_is_that_of_the_record(fragment):
    """Its curves and words; digits may differ by rounding. `python -m benchmarks.explorer_tables` draws it again."""
    shown = re.search(r'<div class="wide" tabindex="0">(<svg.*</svg>)</div>', fragment)[1]
    assert len({re.sub(r"[-.\d ]+", "#", one) for one in (shown, explorer_tables.still())}) == 1


def test_without_webgl_a_picture_stands_in(open_page, file):
    page = open_page(file, before=NO_WEBGL)
    assert page.locator(".still svg").is_visible()
    assert page.locator(".live").is_hidden()
    assert "no WebGL2" in page.locator("[data-part='why']").inner_text()


def test_a_lost_context_shows_the_picture_until_it_is_back(open_page, file):
    explorer = open_page(file)
    explorer.evaluate("window.lost = explorer.device.gl.getExtension('WEBGL_lose_context'); lost.loseContext()")
    explorer.locator(".still svg").wait_for(state="visible")
    explorer.evaluate("lost.restoreContext()")
    explorer.locator(".controls").wait_for(state="visible")
    assert np.all(chosen(explorer, "hazard-diffuse")["rel"] > 0)


def test_a_shader_that_does_not_compile_says_where(open_page, file, tmp_path):
    broken, text, function = tmp_path / "broken.html", file.read_text(), "float law_density(float x, law_Shape s) {"
    assert function in text
    broken.write_text(text.replace(function, f"{function} int x"))
    page = open_page(broken)
    told = page.locator("[data-part='fault']").inner_text()
    assert re.match(r"hazard: values does not compile, line \d+, `float law_density.* int x`: ERROR", told)
    assert page.locator(".measured").is_hidden()


def test_the_address_keeps_what_was_chosen(open_page, file):
    page = open_page(file, fragment="#explorer?law=quantile&A=0.5,0.4,0.3&l=2,1,0.5&view=error&samples=16")
    page.locator("#explorer-radius").fill("0.7")
    page.wait_for_function("location.hash.includes('radius=5')")
    kept = page.evaluate("location.hash")
    assert "law=quantile&A=0.5,0.4,0.3&l=2,1,0.5&samples=16" in kept
    assert "view=error" in kept
    assert page.locator("#explorer-law").input_value() == "quantile"
    assert page.locator("[name='explorer-view'][value='error']").is_checked()


def test_an_address_that_comes_later_is_followed(explorer):
    begun_anew = 64
    for law, more, expected in (
        ("burley-published", "view=constructor&samples=16", ["rr", 16]),
        ("dipole", "view=error&l=2,1,0.5", ["error", begun_anew]),
    ):
        explorer.evaluate(f"location.hash = '#explorer?law={law}&{more}'")
        explorer.wait_for_function(f"explorer.values.law === '{law}'")
        assert explorer.evaluate("[explorer.state.view, explorer.state.samples]") == expected
    assert explorer.locator("#explorer-law").input_value() == "dipole"
    assert explorer.locator("#explorer-l-red + output").inner_text() == "2.00"


@pytest.mark.parametrize("view", ["rr", "rd", "error"])
@pytest.mark.parametrize("channels", [(REFLECTANCE, MFP), ([0.5, 0.5, 0.5], [1, 1, 1])])
def test_curves_can_be_told_apart_without_colour(explorer, view, channels):
    told = explorer.evaluate(
        """([view, A, l]) => {
          Object.assign(explorer.state, { view, reflectance: A, mfp: l, material: null });
          explorer.update();
          const letters = (part) => [...document.querySelectorAll(`[data-part="${part}"] .letter.law`)];
          const told = (one) => [one.textContent, Number(one.getAttribute("x")), Number(one.getAttribute("y"))];
          return ["profile", "cdf", "edge"].map((part) => letters(part).map(told));
        }""",
        [view, *channels],
    )
    for letters in told:
        assert [letter for letter, _, _ in letters] == ["R", "G", "B"]
        places = np.array([place for _, *place in letters])
        assert np.min(np.linalg.norm(places - np.roll(places, 1, axis=0), axis=1)) >= 15


def test_nothing_is_wider_than_a_phone(open_page, file):
    page = open_page(file, width=400, has_touch=True)
    wide = page.evaluate(
        """() => [...document.querySelectorAll(".explorer .live *")].filter((one) => !one.closest("svg, pre, .table"))
          .filter((one) => one.getBoundingClientRect().right > 400.5 || one.getBoundingClientRect().left < 0)
          .map((one) => one.outerHTML)"""
    )
    assert wide == []
    assert page.evaluate("document.documentElement.scrollWidth") <= 400


def test_a_folder_with_one_record_has_its_law_beside_the_printed_ones(tmp_path):
    bare = {law.id for law in offered(tmp_path)}
    assert {"liang-published", "burley-diffuse", "dipole"} <= bare
    for ending in ("json", "npz"):
        shutil.copy(FITS / f"quantile.{ending}", tmp_path)
    found = offered(tmp_path)
    assert {law.id for law in found} - bare == {"quantile"}
    assert first(found) == "quantile"
    assert "float law_profile(float r, float alpha, float mfp)" in found[0].text


# The balls: light that goes into a sphere here and comes out there, by the texts that are exported

BALL = "() => explorer.ball && explorer.ball.done >= explorer.state.samples"
BALL_PLACE = "#explorer?law={}&A=0.3,0.6,0.9&l={}&radius={}&samples=16&turn=40,20&even=0"
WEIGHT = "inside[c] * law_density(x, shape) / p"  # of a sample, in ball.frag


@pytest.fixture(scope="module")
def small(open_shared_page, file):
    return open_shared_page(file, width=300)


def ball(page, place):
    """`sums` after the page was sent to a place."""
    page.evaluate(
        """(place) => new Promise((done) => {
          const drawn = () => requestAnimationFrame(() => requestAnimationFrame(done));
          addEventListener("hashchange", drawn, { once: true });
          location.hash = place;
        })""",
        place,
    )
    return sums(page)


def alphas(page):
    """Of the channels (3,)."""
    return np.array(page.evaluate("explorer.values.channels.map((one) => one.alpha)"))


def sums(page):
    """Unit normals (pixels, 3) of a ball well within its rim; there a sample's mean light over A, and mean weight."""
    page.locator("canvas.ball").scroll_into_view_if_needed()
    page.wait_for_function(BALL)
    side = page.evaluate("explorer.ball.side")
    y, x = np.meshgrid(*2 * [(2.0 * np.arange(side) + 1.0 - side) / (0.94 * side)], indexing="ij")
    inside = np.hypot(x, y) < 0.97
    normal = np.stack([x, y, np.sqrt(np.maximum(1.0 - x**2 - y**2, 0.0))], axis=-1)
    told = json.loads(page.evaluate("JSON.stringify(explorer.ball.told().map((one) => Array.from(one)))"))
    light, weight = (np.reshape(one, (side, side, 4))[inside, :3] / 16 for one in told)
    return normal[inside], light, weight


def lit_by_a_lamp(law, alpha, mfp, radius, cosine):
    """Radiance over A where the light comes in under `cosine` (n,): light at the chord d, around all its circle."""
    chord = np.linspace(0.0, 2.0, 801)  # [radii]
    within = law.cdf(radius * chord, alpha, mfp)
    middle = 0.5 * (chord[1:] + chord[:-1])
    up = (1.0 - 0.5 * middle**2) * cosine[:, None]
    aside = middle * np.sqrt(1.0 - 0.25 * middle**2) * np.sqrt(1.0 - cosine[:, None] ** 2)
    edge = np.clip(up / np.maximum(aside, 1e-12), -1.0, 1.0)
    # The mean of max(up + aside cos phi, 0) over phi.
    mean = (up * np.arccos(-edge) + aside * np.sqrt(1.0 - edge**2)) / np.pi
    return mean @ np.diff(within) / within[-1]


def test_weights_are_of_the_light_within_the_diameter(small, laws):
    # This law draws by another map than the inverse of its cdf: its weights differ.
    _, _, weight = ball(small, BALL_PLACE.format("liang-corrected", "0.5,1,2", 0.5))
    expected = laws["liang-corrected"].cdf(2 * 0.5, alphas(small), np.array([0.5, 1.0, 2.0]))
    mean, five_errors = weight.mean(axis=0), 5 * weight.std(axis=0) / np.sqrt(len(weight))
    assert np.all(np.abs(mean - expected) < five_errors)
    small.evaluate(
        """(right) => {
          explorer.rightBall = explorer.shaders.ball;
          explorer.shaders.ball = explorer.rightBall.replace(right, "inside[c]");
          explorer.programs = null;
          explorer.update();
        }""",
        WEIGHT,
    )
    wrong = sums(small)[2].mean(axis=0)
    small.evaluate("explorer.shaders.ball = explorer.rightBall; explorer.programs = null; explorer.update()")
    assert np.all(np.abs(wrong - expected) > five_errors)


@pytest.mark.parametrize(("mfp", "radius"), [((0.5, 1.0, 2.0), 5.0), ((30.0, 10.0, 1.0), 1.0)])
def test_a_lamp_on_a_ball_is_what_the_law_makes_of_it(small, laws, mfp, radius):
    law = laws["burley-published"]
    normal, light, weight = ball(small, BALL_PLACE.format("burley-published", ",".join(map(str, mfp)), radius))
    alpha = alphas(small)
    within = law.cdf(2 * radius, alpha, np.array(mfp))
    np.testing.assert_allclose(weight, np.broadcast_to(within, weight.shape), rtol=1e-4)  # each sample counts
    around, up = np.radians([40.0, 20.0])
    cosine = normal @ [np.cos(up) * np.sin(around), np.sin(up), np.cos(up) * np.cos(around)]
    steps = np.linspace(-1.0, 1.0, 201)
    for c in range(3):
        expected = np.interp(cosine, steps, lit_by_a_lamp(law, alpha[c], mfp[c], radius, steps))
        for low, high in ((-1.0, -0.3), (-0.3, 0.0), (0.0, 0.3), (0.3, 0.7), (0.7, 1.0)):
            ring = (cosine >= low) & (cosine < high)
            # A sample spreads by less than 0.4, sixteen fall into each pixel; five standard errors.
            bound = 5 * 0.4 / np.sqrt(16 * ring.sum())
            seen = (light[ring, c] / weight[ring, c]).mean()
            assert seen == pytest.approx(expected[ring].mean(), abs=bound)
            if (low, c) == (-0.3, 2):  # Lambert's ball is dark there
                assert expected[ring].mean() > 2 * bound


def test_paper_shows_the_ball_though_it_was_not_in_sight(open_page, file):
    page = open_page(file, width=300, height=300, fragment="#explorer?samples=4")
    printed = page.evaluate(
        """() => {
          const before = explorer.ball.done, { canvas } = explorer, copy = document.createElement("canvas");
          dispatchEvent(new Event("beforeprint"));
          copy.width = copy.height = 1;
          copy.getContext("2d").drawImage(canvas, -0.72 * canvas.width, -0.4 * canvas.height);
          return [before, explorer.ball.done, ...copy.getContext("2d").getImageData(0, 0, 1, 1).data];
        }"""
    )
    assert printed[:2] == [0, 4]
    assert min(printed[2:5]) > 50  # skin in the light
    assert printed[5] == 255


def test_reduced_motion_shows_the_ball_once(open_page, file):
    page = open_page(file, width=300, reduced_motion="reduce", fragment="#explorer?samples=64")
    page.evaluate(
        "window.shown = []; const { show } = explorer.ball;"
        "explorer.ball.show = function () { shown.push(this.done); show.call(this); }; explorer.ball.restart()"
    )
    page.locator("canvas.ball").scroll_into_view_if_needed()
    page.wait_for_function(BALL)
    assert page.evaluate("shown") == [64]
