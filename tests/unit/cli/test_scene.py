"""profilefit scene: from a file to pictures and numbers, and one line for every mistake. A sixth scene is its folder,
tests/unit/scenes/toy, and one line: the command reads, draws and judges it.
"""

import io
import json
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from matplotlib import image

from mcml_sim import Setting
from mcml_sim.files.whole_file import read_toml
from profilefit.errors import InputError
from profilefit.scenes import SCENES
from profilefit.scenes.stage.drawing import RIVALS
from profilefit.shader import opened
from tests.fixtures import EXAMPLES, slow

# What a file of each scene must have: all else may be left out.
NEEDED = {"skin": (), "layers": ("layers",), "heart": ("layers",), "sea": (), "fur": ()}
OWN = {
    "skin": ("label", "material", "setting"),
    "layers": ("pose", "single"),
    "heart": ("surface", "stack", "illumination"),
    "sea": ("sea", "floor", "water"),
    "fur": ("fur", "shading_table"),
}
SMALL = """\
scene = "skin"
[technique]
samples = 4
chart = [64]
[camera]
resolution = [64, 48]
"""


@pytest.fixture
def small(tmp_path):
    path = tmp_path / "small.toml"
    path.write_text(SMALL, encoding="utf-8")
    return path


@pytest.mark.parametrize("name", [*slow("heart"), *(one for one in SCENES if one != "heart")])
def test_the_example_says_what_is_taken_without_it(done, tmp_path, name):
    out = done("scene", name, "--example")
    assert out == Path(EXAMPLES[SCENES[name][1]]).read_text(encoding="utf-8")
    home = import_module(SCENES[name][0])
    path = tmp_path / "printed.toml"
    path.write_text(out, encoding="utf-8")
    content = read_toml(path)
    said, taken = home.read("", content), home.read("", {"scene": name, **{key: content[key] for key in NEEDED[name]}})
    for key in ("technique", "camera", "light", "ambient", "size", *OWN[name]):
        assert getattr(said, key) == getattr(taken, key), key


def test_what_choose_reads_is_ignored():
    """One file serves both commands: neither looks at the keys of the other."""
    skin = import_module(SCENES["skin"][0])
    content = {"scene": "skin", "choose": {"anything": 1}, "technique": {"tolerance": 0.5}}
    assert skin.read("", content).setting == skin.read("", {"scene": "skin"}).setting == Setting("diffuse", n=1.4)


@pytest.mark.slow
@pytest.mark.parametrize("n", [1.0, 1.4])
def test_the_truth_is_of_the_index_that_the_law_is_of(opengl, n):
    """A truth of another index is wrong by more than the noise of so many samples."""
    skin = import_module(SCENES["skin"][0])
    content = {
        "scene": "skin",
        "n": n,
        "camera": {"resolution": [48, 36], "reference_pixel": 1},
        "technique": {"samples": 256},
    }
    request = skin.read("", content)
    other = request.changed()
    vars(other)["method"] = skin.read("", {**content, "n": 2.4 - n}).method
    with opened() as context:
        right, wrong = (skin.draw(context, one).point.rmse for one in (request, other))
    assert right < 0.02
    assert wrong > 3.0 * right


@pytest.mark.slow
def test_a_scene_is_drawn_beside_its_truth(done, small, opengl):
    """All of its files, and an error that falls with samples: the truth is not made of what is judged by it."""
    told = json.loads(done("scene", str(small), "--out", "drawn", "--json", "--quiet"))
    assert json.loads(Path("drawn/small.json").read_text(encoding="utf-8")) == told
    ends = ("-chart.png", "-comparison.png", "-error.png", "-truth.png", ".json", ".png")
    assert sorted(path.name for path in Path("drawn").iterdir()) == [f"small{end}" for end in ends]
    picture, truth = (image.imread(io.BytesIO(Path(f"drawn/small{end}.png").read_bytes())) for end in ("", "-truth"))
    assert (picture.shape[:2], truth.shape[:2]) == ((48, 64), (24, 32))
    halved = picture.reshape(24, 2, 32, 2, -1).mean(axis=(1, 3))
    assert 0.001 < np.abs(halved - truth)[..., :3].mean() < 0.1  # noise of four samples
    assert [one["technique"] for one in told["rivals"]] == ["separable filter", "no scattering"]
    assert image.imread("drawn/small-comparison.png").shape[1] == 1920
    few, many = told["chart"]
    assert (few["samples"], many["samples"]) == (4, 64)
    assert few["rmse"] == told["rmse"]
    assert 0 < many["rmse"] < 0.5 * few["rmse"]
    assert 0 < few["milliseconds"]["least"] <= few["milliseconds"]["median"] <= few["milliseconds"]["most"]
    assert 0 < told["truth_error"]["half"] < told["truth_error"]["rms"] < 0.2


def test_a_picture_without_a_reference(done, small, opengl):
    """It may be larger than a reference, has no error, and nothing is written but it and its numbers."""
    told = json.loads(done("scene", str(small), "--no-reference", "--out", "drawn", "--json", "--quiet"))
    assert sorted(path.name for path in Path("drawn").iterdir()) == ["small.json", "small.png"]
    assert image.imread("drawn/small.png").shape[:2] == (48, 64)
    assert told["samples"] == 4
    assert "rmse" not in told


def test_frames_are_numbered_pictures_of_what_moves(done, command, small, tmp_path, opengl):
    fur = tmp_path / "fur.toml"
    words = "density = 0.1\nforce = [0.0, -0.4, 0.0]\ngust = [0.3, 0.0, 0.0]\nperiod = 4.0"
    size = "supersampling = 1\n[camera]\nresolution = [32, 24]\nreference_pixel = 1"
    fur.write_text(f'scene = "fur"\n[fur]\n{words}\n[technique]\n{size}\n', encoding="utf-8")
    told = json.loads(done("scene", str(fur), "--frames", "3", "--fps", "1", "--out", "drawn", "--json", "--quiet"))
    names = sorted(path.name for path in Path("drawn").iterdir())
    ends = ("-comparison.png", "-error.png", "-truth.png", ".png")
    assert names == sorted(["fur.json", *(f"fur-000{number}{end}" for number in (1, 2, 3) for end in ends)])
    pictures = [image.imread(f"drawn/fur-000{number}.png")[..., :3] for number in (1, 2, 3)]
    np.testing.assert_array_equal(pictures[0], pictures[2])  # half a period later the wind is still, too
    assert np.abs(pictures[0] - pictures[1]).max() > 0.1
    assert [0 < one["rmse"] < 1 for one in told["frames"]] == [True] * 3
    assert "error of the reference: not known\n" in done("scene", str(fur), "--out", "drawn", "--quiet")
    said = "profilefit: --fps must be left out without --frames, got 12\n"
    assert command("scene", str(fur), "--fps", "12", "--out", "other") == (2, "", said)
    said = f"profilefit: {small}: --frames must be left out where nothing moves; sea and fur move\n"
    assert command("scene", str(small), "--frames", "2", "--out", "other") == (2, "", said)
    assert not Path("other").exists()


def test_a_sea_moves_from_frame_to_frame(done, tmp_path, monkeypatch, opengl):
    """The example at a tiny size: in both frames spread beams have a lower error than single scattering."""
    monkeypatch.setattr("profilefit.scenes.sea.scene.PATHS", 40_000)
    text = Path(EXAMPLES["sea.toml"]).read_text(encoding="utf-8")
    tiny = {"resolution": "[12, 9]", "reference_pixel": 1, "vertices": 32, "texels": 64, "slices": 4}
    for key, number in tiny.items():
        text = re.sub(rf"^{key} = (\[.*?\]|\d+)", f"{key} = {number}", text, flags=re.MULTILINE)
    path = tmp_path / "sea.toml"
    path.write_text(text, encoding="utf-8")
    told = json.loads(done("scene", path, "--frames", "2", "--fps", "2", "--out", "drawn", "--json", "--quiet"))
    first, second = (image.imread(f"drawn/sea-000{number}.png")[..., :3] for number in (1, 2))
    assert first.shape == second.shape == (9, 12, 3)
    assert np.abs(first - second).max() > 0.02
    for one in told["frames"]:
        single = next(rival["rmse"] for rival in one["rivals"] if rival["technique"] == "single")
        assert one["rmse"] < 0.5 * single  # 0 where the noise of so few paths is larger than the error


def test_older_files_are_named_and_no_older_frame_follows_new_ones(command, done, toy, monkeypatch, opengl):
    """Nothing is deleted: the JSON lists the files of its run, a note lists the others, and more frames are refused."""
    folder, ends = Path("drawn"), ("", "-truth", "-error", "-comparison", "-chart")
    told = json.loads(done("scene", toy, "--out", folder, "--json", "--quiet"))
    assert told["files"] == [*(f"toy{end}.png" for end in ends), "toy.json"]
    before = (folder / "toy-truth.png").read_bytes()
    code, out, said = command("scene", toy, "--no-reference", "--out", folder, "--json")
    assert (code, json.loads(out)["files"]) == (0, ["toy.png", "toy.json"])
    assert said.splitlines() == [
        "not of this run, and still in drawn: toy-truth.png, toy-error.png, toy-comparison.png, toy-chart.png",
        "wrote drawn/toy.json, drawn/toy.png",
    ]
    assert (folder / "toy-truth.png").read_bytes() == before
    monkeypatch.setattr("tests.unit.scenes.toy.scene.ToyRequest.after", lambda self, _: self)
    words = "scene", toy, "--no-reference", "--out", folder, "--json", "--quiet", "--frames"
    assert json.loads(done(*words, 3))["files"] == [*(f"toy-000{number}.png" for number in (1, 2, 3)), "toy.json"]
    said = "profilefit: drawn/toy-0003.png would follow the 2 frames, but is of a longer run: "
    said += "use --out with another folder, or delete the older pictures\n"
    assert command(*words, 2) == (2, "", said)
    assert len(json.loads((folder / "toy.json").read_text(encoding="utf-8"))["frames"]) == 3
    (folder / "toy-0003.png").unlink()
    assert len(json.loads(done(*words, 2))["files"]) == 3


@pytest.mark.parametrize("name", ["skin", "layers", "heart"])
def test_frames_of_what_stays_still_are_refused(refused, name):
    said = "--frames must be left out where nothing moves; sea and fur move"
    refused(f"scene {SCENES[name][1]} --frames 2 --out drawn", said)
    assert not Path("drawn").exists()


@pytest.mark.parametrize("name", SCENES)
def test_a_picture_of_any_kind_has_two_rivals(name):
    home = import_module(SCENES[name][0])
    rivals = [one["kind"] for one in home.drawer.rivals]
    assert {kind: len({*rivals} - {kind}) >= RIVALS for kind in home.KINDS} == dict.fromkeys(home.KINDS, True)


def test_a_reference_has_a_largest_size(command, small):
    small.write_text(SMALL.replace("[64, 48]", "[4096, 4096]\nreference_pixel = 2"), encoding="utf-8")
    said = (
        f"profilefit: {small}: [camera] resolution over reference_pixel must be 2097152 pixels of a reference at most"
    )
    code, out, error = command("scene", str(small), "--out", "drawn")
    assert (code, out) == (2, "")
    assert error == f"{said}, got 2048 x 2048; a larger picture is drawn with --no-reference\n"
    assert not Path("drawn").exists()


SKIN_MISTAKES = [
    ('"skin"', '"fog"', "scene must be one of skin, layers, heart, sea, fur, got 'fog'"),
    ('scene = "skin"', "", "scene must be one of skin, layers, heart, sea, fur, got nothing"),
    ("samples", "sample",
     "[technique] keys must be of samples, chart, kind, law, constants, illumination, tolerance,"),
    ("samples = 4", "samples = 300", "[technique] samples must be a whole number in 1 ... 256, got 300"),
    ("samples = 4", 'law = "fog"', "[technique] law must be one of liang, burley"),
    ("samples = 4", 'law = "beam_diffusion"\nillumination = "searchlight"',
     "[technique] law must have a closed form to become a shader"),
    ("samples = 4", 'kind = "none"\nlaw = "liang"', "[technique] law must be left out where kind is none, got"),
    ("samples = 4", 'law = "burley"\nconstants = "published:diffuse"',
     "[technique] the published:diffuse constants of burley belong to diffuse, n = 1, g = 0, got a request for "
     "diffuse, n = 1.4, g = 0: write n = 1 at the top of the file, or name another law"),
    ("", "[material.red]\nmfp = 1\n", "[material.red] reflectance must be a number > 0, or two"),
]  # fmt: skip
SEA = """\
scene = "sea"
[water]
a = [0.3, 0.1, 0.08]
b = [0.1, 0.1, 0.1]
source = "assumed"
phase = [[0.9, 0.95], [0.1, 0.3]]
"""
SEA_MISTAKES = [
    ("[0.3, 0.1, 0.08]", "[-0.3, 0.1, 0.08]", "[water] a must be three numbers in 0 ... 100 [1/m], got [-0.3,"),
    ('source = "assumed"\n', "", "[water] source must be a text that says where a and b are from, got nothing"),
    ('source = "assumed"\n', 'source = "assumed"\ntype = "II"\n',
     "[water] type must be left out where a and b are given, got 'II'"),
    ("b = [0.1, 0.1, 0.1]\n", "", "[water] b must be three numbers in 0 ... 100 [1/m], got nothing"),
    ('a = [0.3, 0.1, 0.08]\nb = [0.1, 0.1, 0.1]\nsource = "assumed"', 'type = "IV"',
     "[water] type must be one of IB, II, III, 1C, 3C, 5C, got 'IV'"),
    ("[0.1, 0.3]]", "[0.2, 0.3]]", "[water] lobes must be a list of pairs [weight, g], weights >= 0 that sum to 1"),
    ("[0.1, 0.3]]", "[0.1, 1.0]]", "[water] lobes must be a list of pairs [weight, g], weights >= 0 that sum to 1"),
    ("[[0.9, 0.95], [0.1, 0.3]]", '"fog"',
     "[water] the record of a phase function must be one of petzold, or a .json, got 'fog'"),
    ("", "[floor]\ndepth = 0.1\n", "floor must be below the sea's lowest trough, "),
    ("", "[sea]\nwind = [0, 0]\n", "[sea] wind must be two speeds in -100 ... 100 [m/s], not both 0"),
    ("", "[sea]\nseed = 0.5\n", "[sea] seed must be a whole number in 0 ... 2147483648, got 0.5"),
    ("", "[camera]\nangle = 60\n", "[camera] angle must be the picture's height as an angle in 0 ..."),
    ("", "[camera]\neye = [0, 0, 1]\n", "[camera] eye must be in the water, with z in "),
    ("", "[camera]\ntarget = [6, 2.5, 0]\n", "[camera] target must be a point that is not straight"),
    ("", "[light]\ndirection = [1, 0, 1]\n", "[light] direction must be toward the sun, [x <= 0,"),
    ("", "[technique]\nslices = 33\n", "[technique] slices must be a whole number in 2 ... 32, got 33"),
    ("", "[technique]\nslices = 32\ntexels = 1024\n",
     "[technique] slices must be so many that texels times slices is 16384 at most, got 32"),
    ("", "[light]\nirradiance = [0, 0, 0]\nambient = [0, 0, 0]\n",
     "[light] irradiance and ambient must not both be 0: nothing would be seen"),
]  # fmt: skip
FUR = """\
scene = "fur"
[fur]
density = 0.5
radius = 0.4
length = 8.0
[technique]
kind = "swept"
samples = 8
"""
FUR_MISTAKES = [
    ("0.5", "0", "[fur] density must be a number > 0"),
    ("0.5\nradius = 0.4", "29\nradius = 0.1",
     "[fur] density must be so many strands [1/mm^2] that the ball has 262144 at most, 28.62"),
    ("8.0", "8.0\nclumps = 1", "[fur] clumps must be so many clumps [1/mm^2] that the ball has 8192 at most, 0.8942"),
    ("8.0", "8.0\ngather = 1", "[fur] gather must be a number in 0 ... 0.9, got 1"),
    ("radius = 0.4", "radius = 1.5", "[fur] radius must be at most the strands' mean distance, 1 / sqrt(density)"),
    ("radius = 0.4", "radius = 0.01", "[fur] ball must be at most 640 times the strands' radius, got 27"),
    ("8.0", "-8.0", "[fur] length must be a number > 0 and <= 150, got -8"),
    ("8.0", "8.0\nforce = [0, -2, 0]", "[fur] force must be three numbers in -0.9 ... 0.9, got [0, -2, 0]"),
    ("samples = 8", "exponent = 2", "[technique] exponent must be left out where kind is swept, got 2"),
    ('"swept"', '"shells"\nstrands = 2', "[technique] strands must be left out where kind is shells, got 2"),
    ('"swept"', '"shells"\nexponent = 0', "[technique] exponent must be a number > 0 and <= 100, or"),
    ("samples = 8", "strands = 3", "[technique] strands must be a whole number in 1 ... 2, got 3"),
    ("", "[shading]\nexponents = [1]\n", "[shading] exponents must be two numbers in 0 ..."),
    ("8.0", "150.0\n[camera]\ntarget = [0, 0, 150]\ndistance = 300\ndirection = [0, 0, -1]",
     "[camera] distance must be so long that the eye is "),
]  # fmt: skip
MISTAKES = {SMALL: SKIN_MISTAKES, SEA: SEA_MISTAKES, FUR: FUR_MISTAKES}


@pytest.mark.parametrize(
    ("text", "old", "new", "said"), [(text, *row) for text, rows in MISTAKES.items() for row in rows]
)
def test_a_mistake_is_one_line_that_names_file_and_key(refused, small, text, old, new, said):
    """What takes the place of `old`, or stands at the end of the file."""
    assert old in text
    small.write_text(text.replace(old, new, 1) if old else text + new, encoding="utf-8")
    assert refused(f"scene {small} --out drawn", said).startswith(f"profilefit: {small}: {said}")
    assert not Path("drawn").exists()


@pytest.mark.slow
def test_nothing_to_see_is_one_line(refused, small, opengl):
    small.write_text(f"{SMALL}height = 1\ntarget = [150, 0, 0]\n", encoding="utf-8")  # mm, beside the head
    refused(
        f"scene {small} --out drawn --quiet",
        "the view must show something that light scatters in, and light must reach it",
    )
    assert not list(Path("drawn").iterdir())


def test_names_and_places(refused, small):
    said = "NAME must be one of skin, layers, heart, sea, fur with --example, got 'fog'"
    assert refused("scene fog --example", said) == f"profilefit: {said}\n"
    refused("scene nowhere.toml", "nowhere.toml")
    Path("file").write_text("")
    refused(f"scene {small} --out file", "cannot write into file")


def test_a_file_without_a_gpu_is_one_line(small, tmp_path):
    """In a process that finds no library of OpenGL's."""
    code = "import moderngl, sys\n"
    code += "def missing(**_): raise Exception('libEGL.so.1: cannot open shared object file')\n"
    code += "moderngl.create_context = missing\n"
    code += "from profilefit.cli import main\n"
    code += f"sys.argv = ['profilefit', 'scene', {str(small)!r}, '--out', 'drawn']\nmain()\n"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert done.stderr.startswith("profilefit: no OpenGL 3.3 without a window: libEGL.so.1 is missing")
    assert not list((tmp_path / "drawn").iterdir())


def test_a_list_of_scenes_is_enough_to_refuse(small):
    """`read` is what the shell calls of every scene's home."""
    for home, _ in SCENES.values():
        with pytest.raises(InputError, match=r"here: keys must be of .* got 'other'"):
            import_module(home).read("here", {"scene": "skin", "other": 1})


FILE = 'scene = "toy"\n[technique]\nsamples = 4\nchart = [1, 16]\n[camera]\nresolution = [24, 8]\nreference_pixel = 1\n'


@pytest.fixture
def toy(monkeypatch, tmp_path):
    monkeypatch.setitem(SCENES, "toy", ("tests.unit.scenes.toy.scene", "toy.toml"))  # the line
    path = tmp_path / "toy.toml"
    path.write_text(FILE, encoding="utf-8")
    return str(path)


def test_it_is_drawn_by_the_command(done, opengl, toy):
    told = json.loads(done("scene", toy, "--out", "drawn", "--json", "--quiet"))
    assert sorted(path.name for path in Path("drawn").iterdir()) == [
        *(f"toy{end}" for end in ("-chart.png", "-comparison.png", "-error.png", "-truth.png", ".json", ".png"))
    ]
    assert [one["samples"] for one in told["chart"]] == [1, 4, 16]
    one, four, sixteen = (one["rmse"] for one in told["chart"])
    assert told["rmse"] == four
    np.testing.assert_allclose((four / one, sixteen / four), 0.25, rtol=0.02)  # samples at left ends: 1 / n
    picture, truth = (image.imread(f"drawn/toy{end}.png")[..., :3] for end in ("", "-truth"))
    assert picture.shape == truth.shape == (8, 24, 3)
    np.testing.assert_allclose(picture, truth, atol=2 / 255)
    assert np.all(np.diff(truth[0, :, 0]) < 0)


def test_what_takes_minutes_is_said_before(done, opengl, toy, monkeypatch):
    monkeypatch.setattr("tests.unit.scenes.toy.scene.ToyRequest.wait", "it takes [minutes]")
    words = "scene", toy, "--no-reference", "--out", "drawn", "--json"
    done(*words, said="it takes [minutes]\nwrote drawn/toy.json, drawn/toy.png\n")
    done(*words, "--quiet")


def test_a_picture_is_larger_than_its_reference(done, opengl, toy):
    """A size of which `reference_pixel` is no factor is rounded and said; an error that nobody estimated is no NaN."""
    Path(toy).write_text(FILE.replace("reference_pixel = 1", "reference_pixel = 2"), encoding="utf-8")
    out = done("scene", toy, "--out", "drawn", "--quiet").splitlines()
    assert "error of the reference: not known" in out
    assert "errors, at 12 x 4 pixels, are root mean squares of toy light, over its mean" in out
    picture, truth = (image.imread(f"drawn/toy{end}.png")[..., :3] for end in ("", "-truth"))
    assert (picture.shape, truth.shape) == ((8, 24, 3), (4, 12, 3))
    means = picture.reshape(4, 2, 12, 2, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(means, truth, atol=3 / 255)
    Path(toy).write_text(FILE.replace("reference_pixel = 1", "reference_pixel = 5"), encoding="utf-8")
    out = done("scene", toy, "--out", "drawn", "--quiet")
    assert "errors, at 5 x 2 pixels (24 x 8 over reference_pixel, rounded), are root mean squares of toy light" in out
    assert image.imread("drawn/toy-truth.png").shape[:2] == (2, 5)


def test_its_mistakes_are_one_line(command, toy):
    Path(toy).write_text(FILE.replace("[technique]", "k = -1\n[technique]"), encoding="utf-8")
    assert command("scene", toy, "--out", "drawn") == (2, "", f"profilefit: {toy}: k must be a number > 0, got -1\n")
