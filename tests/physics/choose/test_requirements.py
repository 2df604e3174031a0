"""SCENE.toml: what is read, and one line for every mistake."""

import math
from pathlib import Path

import pytest

from mcml_sim import Setting, exact
from profilefit.errors import InputError
from profilefit.studies.choose.requirements import read

SKIN = Path(__file__).resolve().parents[3] / "examples" / "skin.toml"
SMALL = """\
[view]
pixel = 0.5
[material]
[material.red]
reflectance = 0.6
mfp = [1, 2]
[material.green]
reflectance = 0.4
mfp = 0.7
[material.blue]
reflectance = 0.2
mfp = 0.5
[tolerance]
error = 0.01
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


def test_example():
    scene = read(SKIN)
    assert scene.reflectance[0] == (0.55, 0.75)
    assert scene.radius == 5.0
    assert scene.budget.ms == 5.0
    assert scene.layers.is_grey
    assert [layer.g for layer in scene.layers.media[0].layers] == [0.8, 0.9]


def test_defaults(written):
    scene = read(written())
    assert scene.mfp == ((1.0, 2.0), (0.7, 0.7), (0.5, 0.5))
    assert scene.setting == Setting("diffuse")
    assert math.isinf(scene.radius)
    assert scene.budget.ms is None
    assert (scene.unit, scene.resolution, scene.layers) == ("mm", (1920, 1080), None)


def test_layers_have_colours_and_the_unit_of_the_scene(written):
    stack = "[[layers]]\nn = 1\nmu_a = [1, 2, 3]\nmu_s = 9\ng = 0\n"
    scene = read(written("", stack))
    assert [medium.layers[0].mu_a for medium in scene.layers.media] == [1.0, 2.0, 3.0]
    assert scene.layers.unit == "mm"
    with pytest.raises(InputError, match=r'material must be left out unless unit = "mm", .* got .marble'):
        read(written("[view]", 'unit = "cm"\n[[layers]]\nn = 1\nmaterial = "marble"\n[view]'))


def test_world_scale_and_materials(tmp_path):
    path = tmp_path / "milk.toml"
    path.write_text(
        '[view]\npixel = [0.001, 0.002]\nradius = 0.1\nworld = 1000\n[material]\nname = "skimmilk"\n'
        "[tolerance]\nerror = 0.01\n",
        encoding="utf-8",
    )
    scene = read(path)
    assert scene.pixel == (1.0, 2.0)
    assert scene.radius == 100.0
    alpha = 0.70 / 0.7014
    assert scene.mfp[0][0] == pytest.approx(1.0 / 0.7014)
    assert scene.reflectance[0][0] == pytest.approx(exact.reflectance(alpha, Setting("diffuse")))


WRONG = [
    ("pixel = 0.5", "pixel = 0", r"\[view\] pixel must be a number > 0 or two of them, the smaller first, got 0"),
    ("pixel = 0.5", "pixel = [2, 1]", r"\[view\] pixel must be .* got \[2, 1\]"),
    ("pixel = 0.5", "pixels = 1", r"\[view\] keys must be of pixel, .* got 'pixels'"),
    ("pixel = 0.5", "pixel = 1\nradius = 1", r"\[view\] radius must be at least 2 times the longest .*, 4, got 1"),
    ("pixel = 0.5", "pixel = 1\nradius = true", r"\[view\] radius must be a number > 0, got True"),
    ("pixel = 0.5", "pixel = 1\nresolution = [1]", r"\[view\] resolution must be two whole numbers .* got \[1\]"),
    ("pixel = 0.5", "pixel = 1\ncoverage = 2", r"\[view\] coverage must be a number > 0 and <= 1, got 2"),
    ("reflectance = 0.4", "reflectance = 1.4", r"\[material.green\] reflectance must be .*, <= 1, got 1.4"),
    ("reflectance = 0.4", "", r"\[material.green\] reflectance must be .* got nothing"),
    ("mfp = 0.5", 'mfp = "0.5"', r"\[material.blue\] mfp must be .* got '0.5'"),
    ("mfp = 0.5", "mfp = 0.5\ncolour = 1", r"\[material.blue\] keys must be of reflectance, mfp, got 'colour'"),
    ("[material]", "[material]\nlight = 'sun'", r"\[material\] light must be one of searchlight, diffuse, got 'sun'"),
    ("[material]", "[material]\nindex = 1.7", r"\[material\] index must be a refractive index in \[1, 1.6\], got 1.7"),
    ("[material]", "[material]\nname = 'skin1'", r"\[material\] name must be left out where red, green, blue are"),
    ("[tolerance]\nerror = 0.01", "", r"table \[tolerance\] is missing"),
    ("error = 0.01", "error = 0.01\nmfp = -1", r"\[tolerance\] mfp must be a number > 0, got -1"),
    ("", "[budget]\ngpu = 'voodoo'", r"\[budget\] gpu must be one of switch, .* got 'voodoo'"),
    ("", "[extra]", "keys must be of unit, view, .* got 'extra'"),
    ("", "[[layers]]\nn = 1\nmu_a = 1\nmu_s = 1", r"\[layers 1\] g must be a number, got nothing"),
    ("", "[[layers]]\nn = 1\nmu_a = -1\nmu_s = 1\ng = 0", r"\[layers 1\] mu_a must be a coefficient >= 0.* got -1"),
    ("", "[[layers]]\nn = 1\nmu_a = 1\nmu_s = 1\ng = 0\ndepth = 2", r"\[layers 1\] keys must be of .* got 'depth'"),
    ("", "[[layers]]\nn = 1\nmu_a = [1, 2]\nmu_s = 1\ng = 0", r"\[layers 1\] mu_a must be .* or three .* got \[1, 2\]"),
    ("[view]", "layers = []\n[view]", r"toml: layers must be tables \[\[layers\]\], got \[\]"),
    ("[view]", "[view", "is not TOML: "),
    ("pixel = 0.5", f"pixel = {10**400}", r"a whole number of 401 digits, of 300 at most, of 'pixel' \(at line"),
    ("pixel = 0.5", f"pixel = 0x1{'0' * 5000}", r"\[view\] pixel must be .*, got one of more than 4300 digits"),
    ("pixel = 0.5", f"pixel = {'9' * 5000}", r"a whole number of 5000 digits, of 300 at most, of 'pixel' \(at line"),
    ("pixel = 0.5", "pixel = 1e400", r"is not TOML: the number 1e400, beyond floating point, of 'pixel' \(at line"),
    ("pixel = 0.5", "pixel = 1e300", r"\[view\] pixel must be between 1e-09 and 1e\+09 in the unit .*, got 1e\+300"),
    ("pixel = 0.5", "pixel = 1e300\nworld = 1e300", r"\[view\] pixel must be between .*, got inf"),
    ("pixel = 0.5", "pixel = 1\nradius = 1e300\nworld = 1e5", r"\[view\] radius must be between .*, got 1.*e\+305"),
    ("pixel = 0.5", "pixel = 1\nradius = nan", r"\[view\] radius must be a number > 0, got nan"),
    ("pixel = 0.5", f"pixel = 1\n{'a.' * 100_000}b = 1", "is not TOML: tables or lists nested more than 32 deep"),
    ("pixel = 0.5", f"pixel = {'[' * 100_000}", "is not TOML: tables or lists nested more than 32 deep"),
    ("pixel = 0.5", f"pixel = {[1] * 1000}", r"\[view\] pixel must be .*, got \[1, 1.*\.\.\.$"),
    ("pixel = 0.5", f'pixel = "{"x" * 1000}"', r"\[view\] pixel must be .*, got 'x+\.\.\.$"),
    ("mfp = 0.5", "mfp = 1e-300", r"\[material.blue\] mfp must be between"),
    ("error = 0.01", 'error = 0.01\nmfp = "4"', r"\[tolerance\] mfp must be a number > 0, got '4'"),
    ("error = 0.01", "error = 0.01\nmfp = true", r"\[tolerance\] mfp must be a number > 0, got True"),
    ("error = 0.01", "error = 0.01\nmfp = 101", r"\[tolerance\] within.mfp must be .* \(0, 100\], got 101"),
    (
        "error = 0.01",
        "error = 0.01\npixels = 1.5",
        r"\[tolerance\] pixels must be a whole number in 1 ... 100, got 1.5",
    ),
    ("", "[budget]\ngpu = ['voodoo']", r"\[budget\] gpu must be one of switch, .* got \['voodoo'\]"),
    (
        "",
        f"[[layers]]\nn = {10**400}\nmu_a = 1\nmu_s = 1\ng = 0",
        r"a whole number of 401 digits, of 300 at most, of 'n' \(at line",
    ),
    ("", "[[layers]]\nn = 1\nmu_a = '1'\nmu_s = 1\ng = 0", r"\[layers 1\] mu_a must be .*, got '1'"),
    ("[view]", 'unit = "\\u001b[31m"\n[view]', r"unit must be a text of 60 characters at most, got '\\x1b\[31m'"),
]


@pytest.mark.parametrize(
    ("old", "new", "message"), WRONG, ids=[(new.splitlines()[-1] if new else old)[:30] for old, new, _ in WRONG]
)
def test_mistakes_are_one_line(written, old, new, message):
    path = written(old, new)
    with pytest.raises(InputError, match=message) as caught:
        read(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_missing_file(tmp_path):
    with pytest.raises(InputError, match=r"absent.toml: expected a file that can be read, got: No such file"):
        read(tmp_path / "absent.toml")
