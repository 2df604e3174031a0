"""Passes as values: what they read, what they write, and that every uniform is set and stands in the source."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

import profilefit
from benchmarks.planes import flat, step_edge
from mcml_sim import Setting
from profilefit.errors import ShaderError
from profilefit.scenes.skin import material
from profilefit.scenes.stage.pattern import Sampling
from profilefit.scenes.stage.renderer import Pass, uniforms_of
from profilefit.scenes.stage.technique import EXITANCE, Gather, Lambert, LawText, Technique, maps
from tests.unit.scenes.scenes import ball, refused, scene

SIZE = (128, 128)
SOURCE = """
// uniform float not_this;
uniform sampler2D irradiance_map, table;
uniform float factor; /* uniform float
nor_this; */
#if 0
uniform vec3 switched_off[2], too;
#endif
out vec4 light;
void main() {
    light = factor * texelFetch(irradiance_map, ivec2(gl_FragCoord.xy), 0) + texelFetch(table, ivec2(0), 0);
}
"""
TABLE = np.full((1, 1, 4), 0.25, np.float32)


@dataclass(frozen=True)
class Scaled(Technique):
    """Two passes through a map of their own."""

    uniforms: dict = field(default_factory=lambda: {"factor": 3.0})
    table: np.ndarray = field(default_factory=lambda: TABLE)

    def passes(self, frame):
        source = SOURCE.replace("uniform vec3 switched_off[2], too;", "")
        return [
            Pass("scaled", {"irradiance_map": read, "table": self.table}, into, source, self.uniforms)
            for read, into in (("irradiance_map", "between_map"), ("between_map", EXITANCE))
        ]

    def through(self):
        return LawText.of_share("scaled", "1.0")


def test_uniforms_are_those_of_the_source():
    assert uniforms_of(SOURCE) == {"irradiance_map", "table", "factor", "switched_off", "too"}


def test_a_technique_adds_its_passes(stage):
    stage.upload(flat(SIZE, 1.0, 0.5))
    np.testing.assert_array_equal(stage.scatter(Scaled(), 1.0), np.full((128, 128, 3), 3.0 * 3.25 + 0.25))
    again = stage.scatter(Scaled(table=2.0 * TABLE), 1.0)  # another array in the same program
    np.testing.assert_array_equal(again, np.full((128, 128, 3), 3.0 * 3.5 + 0.5))
    assert stage.renderer.compiled == ["scaled"]


class Unread(Lambert):
    def passes(self, frame):
        return [replace(one, reads=maps("irradiance_map", "position_map")) for one in super().passes(frame)]


@pytest.mark.parametrize(
    ("by", "message"),
    [
        (
            Scaled({"factor": 1.0, "size": 2.0}),
            "shader 'scaled': uniform size is set, but stands nowhere in its source",
        ),
        (Scaled({}), "shader 'scaled': uniform factor stands in its source, but is never set"),
        (Unread(), "uniform reflectance_map stands in its source, but is never set"),
    ],
    ids=["a uniform too many", "a uniform too few", "a map too few"],
)
def test_a_shader_without_its_other_half_is_an_error(stage, by, message):
    stage.upload(flat(SIZE, 1.0, 0.5))
    refused(message, stage.scatter, by, 1.0, error=ShaderError)


@pytest.fixture(scope="module")
def law():
    """The text of the project's law for diffuse light."""
    return Gather.of(profilefit.load("hazard", setting=Setting("diffuse"))).law


def test_a_law_takes_its_shape_and_colour_from_other_channels(stage, law):
    """Red for blue, on a ball that the light shines through: that of the ball of the other colours, to the bit."""
    behind, mfp = (0.2, 0.4, -1.0), (12.0, 6.0, 9.0)
    swapped = Gather(replace(law, shape="law_shape(law_alpha(surface[2 - c]))", colour="\n  surface[2 - c]\n"))
    drawn = {}
    for name, colours, by in (("other", (0.3, 0.5, 0.8), Gather(law)), ("swapped", (0.8, 0.5, 0.3), swapped)):
        stage.draw(scene(behind, replace(ball(), reflectance=material.plain(colours)), kind="perspective"))
        drawn[name] = stage.scatter(by, mfp), stage.render(by, mfp)
    for other, found in zip(*drawn.values(), strict=True):
        np.testing.assert_array_equal(found, other)
    light, radiance = drawn["swapped"]
    assert np.mean(radiance > light / np.pi + 1e-3) > 0.1  # some of it shone through
    assert np.max(np.abs(stage.scatter(Gather(law), mfp) - light)) > 0.01  # the comparison can fail


def test_a_colour_that_the_shape_gives(stage, law):
    """A map that holds albedos, and no A."""
    alpha = np.array([0.95, 0.8, 0.5])
    colour = profilefit.load("hazard", setting=Setting("diffuse")).albedo.reflectance(alpha)
    stage.upload(flat(SIZE, 1.0, alpha))
    by = Gather(replace(law, shape="law_shape(surface[c])", colour="law_reflectance(shape)"))
    for mfp in (2.0, 1e-3):  # blurred all over, and nowhere
        light = stage.scatter(by, mfp)
        np.testing.assert_allclose(light, np.broadcast_to(colour, light.shape), rtol=1e-5)  # float32


def test_lambert_is_the_light_that_arrives(stage):
    edge = step_edge(SIZE, 1.0, (0.7, 0.5, 0.3))
    stage.upload(edge)
    np.testing.assert_array_equal(stage.scatter(Lambert(), 2.0, Sampling(1)), edge.irradiance * edge.reflectance)
    assert np.isfinite(stage.render(Lambert(), 2.0)).all()
