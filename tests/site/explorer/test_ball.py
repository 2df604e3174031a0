"""The explorer's balls: light that goes into a sphere here and comes out there, by the texts that are exported."""

import json

import numpy as np
import pytest

pytestmark = pytest.mark.slow

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
