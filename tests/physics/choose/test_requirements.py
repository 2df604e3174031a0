"""SCENE.toml: one file for `choose` and `scene`, and one line for every mistake."""

import math
import tomllib
from pathlib import Path

import pytest

from mcml_sim import Setting, exact
from profilefit.scenes.layers.half_space import one_half_space
from profilefit.scenes.skin import scene as skin
from profilefit.studies.choose.requirements import read
from tests.fixtures import refused

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
SMALL = """\
scene = "skin"
n = 1.0
[material.red]
reflectance = 0.6
mfp = [1, 2]
[material.green]
reflectance = 0.4
mfp = 0.7
[material.blue]
reflectance = 0.2
mfp = 0.5
[technique]
tolerance = 0.01
[camera]
height = 30.0
resolution = [80, 60]
[choose]
gpu = "ps5"
"""


@pytest.fixture
def written(tmp_path):
    """The small scene with a line replaced."""

    def write(old="", new=""):
        assert old in SMALL
        path = tmp_path / "scene.toml"
        path.write_text(SMALL.replace(old, new, 1) if old else SMALL + new, encoding="utf-8")
        return path

    return write


def test_a_painted_face():
    scene = read(EXAMPLES / "skin.toml")
    assert (scene.setting, scene.reflectance[0]) == (Setting("diffuse", n=1.4), (0.55, 0.75))
    assert (scene.pixel, scene.radius, scene.resolution) == ((0.15, 0.8), 5.0, (1920, 1080))
    assert (scene.tolerance, scene.budget.ms) == (0.02, 5.0)
    assert scene.layers.is_grey
    assert [(layer.n, layer.g) for layer in scene.layers.media[0].layers] == [(1.4, 0.8), (1.4, 0.9)]


def test_a_file_of_a_scene_is_one_of_choose():
    """Material, index and pixel are those that `scene` draws; the example says what holds without it."""
    said = read(EXAMPLES / "skin-head.toml")
    assert said == read("here.toml", {"scene": "skin"})
    alpha = 0.74 / 0.772
    assert said.mfp[0] == (pytest.approx(1 / 0.772),) * 2
    assert said.reflectance[0] == (pytest.approx(exact.reflectance(alpha, Setting("diffuse", n=1.4))),) * 2
    assert said.pixel == (150.0 / 540.0,) * 2
    assert (said.resolution, said.tolerance, said.budget.ms) == ((960, 540), 0.02, None)


def test_a_painted_face_is_drawn_in_the_middle_of_its_ranges():
    content = tomllib.loads((EXAMPLES / "skin.toml").read_text(encoding="utf-8"))
    request = skin.read("skin.toml", content)
    middle = request.material.middle(request.setting)
    assert middle.reflectance == pytest.approx((0.65, 0.40, 0.275))
    assert middle.mfp[0] == pytest.approx(math.sqrt(1.1 * 1.4))
    assert exact.reflectance(middle.alpha[0], request.setting) == pytest.approx(0.65)


@pytest.mark.slow
def test_layers_require_what_the_half_space_nearest_to_them_does():
    scene = read(EXAMPLES / "layers-head.toml")
    near = [one_half_space(medium, "diffuse", 4.0) for medium in scene.layers.media]
    assert scene.setting == Setting("diffuse", n=1.4)
    assert scene.reflectance == tuple((one.reflectance,) * 2 for one in near)
    assert scene.mfp == tuple((one.mfp,) * 2 for one in near)


def test_defaults(written):
    scene = read(written())
    assert (scene.mfp, scene.setting) == (((1.0, 2.0), (0.7, 0.7), (0.5, 0.5)), Setting("diffuse"))
    assert math.isinf(scene.radius)
    assert (scene.pixel, scene.resolution) == ((0.5, 0.5), (80, 60))
    assert (scene.unit, scene.budget.ms, scene.layers) == ("mm", None, None)
    assert read(written("reflectance = 0.6", "reflectance = 0.95")).reflectance[0] == (0.95, 0.95)
    scene = read(written("", "[[layers]]\nn = 1\nmu_a = [1, 2, 3]\nmu_s = 9\ng = 0\n"))  # they have colours
    assert [medium.layers[0].mu_a for medium in scene.layers.media] == [1.0, 2.0, 3.0]


def test_an_older_file_is_told_what_to_write(tmp_path):
    path = tmp_path / "old.toml"
    path.write_text(
        "[view]\npixel = [0.15, 0.8]\nworld = 1.0\n[tolerance]\nerror = 0.02\n[budget]\nms = 5.0\n"
        '[material]\nlight = "diffuse"\nindex = 1.4\nname = "skin1"\n',
        encoding="utf-8",
    )
    assert refused("older format", read, path) == (
        f'{path}: keys are of an older format: write scene = "skin" and [choose] pixel for [view] pixel, '
        "lengths in mm for [view] world, [technique] illumination for [material] light, n for [material] index, "
        "material for [material] name, [technique] tolerance for [tolerance] error, [choose] ms for [budget] ms"
    )


BAD_PIXEL = r"\[choose\] pixel must be a number in 1e-09 \.\.\. 1e\+09, or two of them, the smaller first, got "
GPU = 'gpu = "ps5"'
# A colour that a surface of n = 1.4 does not let out.
REFRACTED, PALE = (f"n = 1.0\n[material.red]\nreflectance = {a}" for a in (0.6, 0.95))
WRONG = [
    (GPU, "pixel = 0", BAD_PIXEL + "0"),
    (GPU, "pixel = [2, 1]", BAD_PIXEL + r"\[2, 1\]"),
    (GPU, "pixel = [1, 2e6]", BAD_PIXEL + r"\[1, 2000000.0\]"),
    (GPU, "pixels = 1.5", r"\[choose\] pixels must be a whole number in 1 ... 100, got 1.5"),
    (GPU, "size = 1", r"\[choose\] keys must be of pixel, .* got 'size'"),
    (GPU, "radius = 1", r"\[choose\] radius must be at least 2 times the longest .*, 4, and at most .*, got 1"),
    (GPU, "radius = true", r"\[choose\] radius must be a number > 0, got True"),
    (GPU, "radius = nan", r"\[choose\] radius must be a number > 0, got nan"),
    (GPU, "radius = 1e305", r"\[choose\] radius must be at least .* and at most 1e\+09 mm, got 1e\+305"),
    (GPU, "resolution = [1]", r"\[choose\] resolution must be two whole numbers .* got \[1\]"),
    (GPU, "coverage = 2", r"\[choose\] coverage must be a number > 0 and <= 1, got 2"),
    (GPU, "mfp = -1", r"\[choose\] mfp must be a number > 0 and <= 100, got -1"),
    (GPU, "mfp = 101", r"\[choose\] mfp must be a number > 0 and <= 100, got 101"),
    (GPU, "gpu = 'voodoo'", r"\[choose\] gpu must be one of switch, .* got 'voodoo'"),
    (GPU, "gpu = ['voodoo']", r"\[choose\] gpu must be one of switch, .* got \['voodoo'\]"),
    ("reflectance = 0.4", "reflectance = 1.4", r"\[material.green\] reflectance must be .* and <= 1, or .*, got 1.4"),
    ("reflectance = 0.4", "", r"\[material.green\] reflectance must be .* got nothing"),
    (REFRACTED, PALE.replace("1.0", "1.4"), r"\[material.red\] reflectance must be .* and <= 0.923, or .*, got 0.95"),
    ("mfp = 0.5", 'mfp = "0.5"', r"\[material.blue\] mfp must be .* got '0.5'"),
    ("mfp = 0.5", "mfp = 0.5\ncolour = 1", r"\[material.blue\] keys must be of reflectance, mfp, got 'colour'"),
    ("mfp = 0.5", "mfp = 1e-300", r"\[material.blue\] mfp must be a number in 1e-09 \.\.\. 1e\+09"),
    ("tolerance = 0.01", "illumination = 'sun'", r"\[technique\] illumination must be one of searchlight, diff"),
    ("n = 1.0", "n = 1.7", r"toml: n must be a refractive index in \[1, 1.6\], got 1.7"),
    ("n = 1.0", 'n = 1.0\nunit = "cm"', r"toml: unit must be one of mm, got 'cm'"),
    ("tolerance = 0.01", "tolerance = 2", r"\[technique\] tolerance must be a number > 0 and <= 1, got 2"),
    ('"skin"', '"fog"', "scene must be one of skin, layers, heart, sea, fur, got 'fog'"),
    ('"skin"', '"sea"', "scene must be one of skin, layers, got 'sea'"),
    ('scene = "skin"', "", "scene must be one of skin, layers, heart, sea, fur, got nothing"),
    ('"skin"', "[1]", r"scene must be one of skin, layers, heart, sea, fur, got \[1\]"),
    ("", "[extra]", "keys must be of title, unit, .* got 'extra'"),
    ("", "[[layers]]\nn = 1\nmu_a = 1\nmu_s = 1", r"\[layers 1\] g must be a finite number, got nothing"),
    ("n = 1.0", "n = 1.0\nlayers = []", r"toml: layers must be tables \[\[layers\]\], got \[\]"),
    ("[choose]", "[choose", "is not TOML: "),
    (GPU, f"pixel = {10**400}", r"a whole number of 401 digits, of 300 at most, of 'pixel' \(at line"),
    (GPU, "pixel = 1e300", BAD_PIXEL + r"1e\+300"),
    (GPU, f"pixel = {[1] * 1000}", r"\[choose\] pixel must be .*, got \[1, 1.*\.\.\.$"),
]


@pytest.mark.parametrize(
    ("old", "new", "message"), WRONG, ids=[(new.splitlines()[-1] if new else old)[:30] for old, new, _ in WRONG]
)
def test_mistakes_are_one_line(written, old, new, message):
    path = written(old, new)
    assert refused(message, read, path).startswith(str(path))
