"""`profilefit photo` as a user meets it."""

import json
import re
import struct
from html import escape
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
import OpenEXR
import pytest
import rawpy
import tifffile
import typer

from profilefit.cli.photo import SeveralFiles, _known
from profilefit.errors import InputError
from profilefit.measured.photo import setup
from profilefit.measured.photo.exposure import read
from profilefit.shader import opened

EMPTY = "#version 330\nvoid main() { gl_Position = vec4(0.0); }"
SETUP = """
[medium]
mu_s = [1.0, 1.0, 1.0]
mu_a = [0.05, 0.05, 0.05]
[camera]
sides = [400, 300]
pitch = 0.1
exposures = 4
[cards]
white = true
grey = 0.18
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Photographs of a spot and of two cards, and files that are none."""
    out = tmp_path_factory.mktemp("shots")
    (out / "SETUP.toml").write_text(SETUP)
    setup.written(setup.read_setup(out / "SETUP.toml"), out)
    whole = (out / "spot-1.dng").read_bytes()
    (out / "empty.dng").write_bytes(b"")
    (out / "notes.txt").write_text("spot")
    tifffile.imwrite(out / "eight.tif", np.zeros((30, 40), np.uint8))
    tifffile.imwrite(out / "four.tif", np.zeros((30, 40, 4), np.uint16), photometric="rgb")
    tifffile.imwrite(out / "huge.tif", np.full((30, 40), 1e35, np.float32))
    tifffile.imwrite(out / "whole.tif", np.arange(1200, dtype=np.uint16).reshape(30, 40), compression="zlib")
    packed = bytearray((out / "whole.tif").read_bytes())
    for name, size in (("six", 6), ("ten", 10)):
        (out / f"{name}.tif").write_bytes(packed[:size])
    packed[-200:-100] = bytes(100)
    (out / "torn.tif").write_bytes(packed)
    tifffile.imwrite(out / "other.tif", np.zeros((30, 40), np.uint16))
    tifffile.imwrite(out / "big.tif", np.zeros((2, 2), np.uint16))
    with tifffile.TiffFile(out / "big.tif", mode="r+b") as file:
        for name, value in (("ImageWidth", 25_000), ("ImageLength", 20_000)):  # as a header may claim
            file.pages[0].tags[name].overwrite(value)
    cv2.imwrite(str(out / "whole.jpg"), np.zeros((300, 400), np.uint8))
    coded = (out / "whole.jpg").read_bytes()
    (out / "cut.jpg").write_bytes(coded[:-40])
    (out / "none.jpg").write_bytes(whole[:1000])
    sides = coded.index(b"\xff\xc0") + 5  # rows, columns
    for name, columns in (("big", 12_500), ("bigger", 25_000)):
        (out / f"{name}.jpg").write_bytes(coded[:sides] + struct.pack(">HH", 10_000, columns) + coded[sides + 4 :])
    return out


def several(folder, name):
    return [str(path) for path in sorted(folder.glob(f"{name}-*.dng"))]


def test_a_setup_becomes_photographs_and_what_they_could_tell(done, tmp_path):
    (tmp_path / "SETUP.toml").write_text(SETUP)
    out = done("photo", "--simulate", "SETUP.toml", "--out", "shots", said="wrote 12 photographs into shots\n")
    assert len(list((tmp_path / "shots").glob("*.dng"))) == 12
    best = {line.split("  ")[0]: line for line in out.splitlines() if "green" in line}
    alone, both = (float(best[name].split()[-2]) for name in ("no cards", "both"))
    assert both < 0.7 * alone


def test_a_bracket_and_its_cards_give_the_medium(done, folder, tmp_path):
    """Every option that takes files takes all that follow it, as a shell writes them out."""
    cards = ["--card", *several(folder, "card"), "--grey", *several(folder, "grey")]
    words = ["--scale", "0.1mm/px", "--beam", "0.5mm+-0.05mm", "--out", "skin"]
    said = "wrote photo.html, photo.json, medium.glsl and 4 figures into skin\n"
    out = done("photo", *several(folder, "spot"), *cards, *words, said=said)
    assert max(map(len, out.splitlines())) <= 100
    found = json.loads((tmp_path / "skin" / "photo.json").read_text())
    for one in found["colours"].values():
        for name, truth in (("mu_s'", 1.0), ("mu_a", 0.05)):
            assert abs(np.log(one["values"][name] / truth)) < 3.5 * one["errors"][name] / one["values"][name]
            assert one["at_best"][name] < 0.1
    drawings = {f"photo-{name}.{kind}" for name in ("spot", "rings") for kind in ("png", "svg")}
    files = {one.name for one in (tmp_path / "skin").iterdir()}
    assert files == {"photo.html", "photo.json", "medium.glsl", *drawings}
    assert "no card was photographed" not in out
    page = (tmp_path / "skin" / "photo.html").read_text()
    assert page.count("<svg") == 2
    told = (tmp_path / "skin" / "medium.glsl").read_text()
    assert escape(told) in page
    for name, of in (("albedo", "alpha"), ("mfp", "l")):
        constants = re.search(rf"const vec3 medium_{name} = vec3\((.*)\); // \+- (.*)\n", told).groups()
        for text, kind, digits in zip(constants, ("values", "errors"), (1e-5, 0.1), strict=True):
            expected = [one[kind][of] for one in found["colours"].values()]
            np.testing.assert_allclose([float(number) for number in text.split(", ")], expected, rtol=digits)
    with opened() as context:
        main = "out float y; void main() { y = medium_profile(1.0, medium_albedo.g, medium_mfp.g); }"
        context.program(EMPTY, "\n".join(["#version 330", told, main])).release()


SCALE = ("--scale", "0.1mm/px")


def test_a_beam_by_its_full_width_at_half_maximum():
    found = _known("--beam", "fwhm:0.2mm+-0.02mm", lengths=True)
    assert (found.value, found.error) == pytest.approx((0.16986436, 0.016986436), rel=1e-7)


def linear(folder, name):
    """Shares of white (exposures, rows, columns): of a setup whose colours are alike, the mosaic is a grey picture."""
    found = []
    for path in several(folder, name):
        with rawpy.imread(path) as raw:
            found.append(np.clip((raw.raw_image_visible.astype(np.float32) - 256) / 3839, 0, 1))
    return np.array(found)


@pytest.mark.slow
def test_floats_clip_where_they_have_a_plateau_only(done, folder, tmp_path):
    shares = linear(folder, "spot")
    for at, one in enumerate(shares):
        with OpenEXR.File({"type": OpenEXR.scanlineimage}, {"Y": one}) as file:
            file.write(str(tmp_path / f"spot-{at}.exr"))
    tifffile.imwrite(tmp_path / "one.tif", shares[0])
    for files in ([f"spot-{at}.exr" for at in range(len(shares))], ["one.tif"]):
        out = done("photo", *files, *SCALE, "--beam", "0.5mm+-0.05mm", "--json")
        one = json.loads(out)["colours"]["grey"]
        for name, truth in (("mu_s'", 1.0), ("mu_a", 0.05)):
            assert abs(np.log(one["values"][name] / truth)) < 3.5 * one["errors"][name] / one["values"][name]


@pytest.mark.slow
def test_a_colour_of_noise_alone_changes_no_time(done, folder, tmp_path):
    """Floats, red on a pedestal of noise or of one value, the longest exposure first."""
    noise = np.random.default_rng(2).normal(0.002, 0.0005, linear(folder, "spot").shape).astype(np.float32)
    answers = []
    for pedestal in (noise, np.full_like(noise, 0.001)):
        files = []
        for at, one in list(enumerate(linear(folder, "spot")[:3]))[::-1]:
            files.append(f"spot-{at}.tif")
            tifffile.imwrite(tmp_path / files[-1], np.stack([pedestal[at], one, one], axis=-1), photometric="rgb")
        out = done("photo", *files, *SCALE, "--beam", "0.5mm+-0.05mm", "--json")
        answers.append(json.loads(out))
        assert list(answers[-1]["colours"]) == ["green", "blue"]
        np.testing.assert_allclose(answers[-1]["times"], [1.0, 0.25, 0.0625], rtol=0.06)
    first, second = (one["colours"]["green"]["values"]["mu_a"] for one in answers)
    assert first == pytest.approx(second, rel=0.02)


def test_white_of_sixteen_bits_is_where_pixels_pile_up(tmp_path):
    """Of 14 bits less black: 15300 steps; and of a picture too dim to clip."""
    rng = np.random.default_rng(1)
    spot = 3e4 * np.exp(-0.5 * (np.hypot(*np.mgrid[-60:60, -60:60]) / 12) ** 2) + rng.normal(100, 10, (120, 120))
    for name, scale, white in (("bright", 1.0, 15300.0), ("dim", 0.01, 65535.0)):
        tifffile.imwrite(tmp_path / f"{name}.tif", np.clip(scale * spot, 0, 15300).astype(np.uint16))
        assert read(tmp_path / f"{name}.tif").planes[0].range == white


@pytest.mark.slow
def test_a_colour_without_a_spot_is_left_out_and_each_has_its_dark_level(done, refused, folder, tmp_path):
    """RGB of sixteen bits, blue dark; red and green of the same light on levels of their own."""
    levels = np.array([300, 600, 900], np.float32)
    for at, one in enumerate(linear(folder, "spot")[:2]):
        picture = 4095 * one[..., None] * [1, 1, 0]
        tifffile.imwrite(tmp_path / f"spot-{at}.tif", (picture + levels).astype(np.uint16))
    tifffile.imwrite(tmp_path / "dark.tif", np.broadcast_to(levels, picture.shape).astype(np.uint16))
    words = (*SCALE, "--beam", "0.5mm+-0.05mm", "--dark", "dark.tif", "--json")
    found = json.loads(done("photo", "spot-0.tif", "spot-1.tif", *words))
    assert list(found["colours"]) == ["red", "green"]
    assert found["notes"] == ["blue: no spot is seen, so it is left out"]
    red, green = (found["colours"][one]["values"] for one in found["colours"])
    assert red["mu_a"] == pytest.approx(green["mu_a"], rel=1e-3)
    tifffile.imwrite(tmp_path / "grey.tif", (4095 * one).astype(np.uint16))
    for more in ("grey.tif", "--dark dark.tif --card grey.tif", "--dark grey.tif"):
        refused(
            f"photo spot-0.tif {more} --scale 0.1mm/px",
            "grey.tif: expected planes red, green, blue as spot-0.tif has, got planes grey",
        )


def test_photographs_of_another_camera_are_not_replaced(command, refused, tmp_path):
    (tmp_path / "SETUP.toml").write_text(SETUP)
    (tmp_path / "shots").mkdir()
    (tmp_path / "shots" / "grey-2.dng").write_bytes(b"mine")
    refused(
        "photo --simulate SETUP.toml --out shots",
        "shots/grey-2.dng: expected no photograph of that name, or one that was simulated, got another",
    )
    assert [one.name for one in (tmp_path / "shots").iterdir()] == ["grey-2.dng"]
    (tmp_path / "shots" / "grey-2.dng").unlink()
    for _ in range(2):  # its own it makes again
        assert command("photo", "--simulate", "SETUP.toml", "--out", "shots")[0] == 0
    (tmp_path / "SETUP.toml").write_text(SETUP.replace("white = true", "white = false"))
    refused(
        "photo --simulate SETUP.toml --out shots",
        "shots/card-1.dng: expected none but photographs of this setup in its folder, got another",
    )


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("sides = [400, 300]", "sides = [400, 30]"), "[camera] sides must be at least 50 pixels each, got [400, 30]"),
        (("pitch", "bits = 8\npitch"), "[camera] black must be less than 255, white of 8 bits, got 256"),
        (("pitch", "uneven = 0.5\npitch"), "[camera] uneven must be a number > 0 and <= 0.1, got 0.5"),
        (("pitch", "corner = 10\npitch"), "[camera] corner must be a number > 0 and <= 0.9, got 10"),
        (("pitch", "late = 1\npitch"), "[camera] late must be a number > 0 and <= 0.2, got 1"),
        (("white = true", "white = 1"), "[cards] white must be true or false, got 1"),
        (("[camera]", "[optics]\nfalling = 0.8\n[camera]"), "[optics] falling must be a number > 1, or its light"),
        (("1.0]\nmu_a = [0.05,", "0.001]\nmu_a = [0.05, 0.05, 0.001] #"), "[medium] mu_s + mu_a must be >= 0.01"),
    ],
)
def test_a_setup_that_makes_no_photograph_is_named(refused, tmp_path, change, said):
    (tmp_path / "SETUP.toml").write_text(SETUP.replace(*change))
    refused("photo --simulate SETUP.toml --out shots", said)
    assert not (tmp_path / "shots").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("SPOT", "--scale must be given: 0.05mm/px"),
        ("SPOT --scale aruco:20mm", "--scale must be a marker that"),
        ("--scale 0.1mm/px", "SHOT must be a photograph"),
        ("missing.dng --scale 0.1mm/px", "missing.dng: cannot be read"),
        ("notes.txt --scale 0.1mm/px", "expected a raw file"),
        ("empty.dng --scale 0.1mm/px", "expected a photograph of 1 byte"),
        ("eight.tif --scale 0.1mm/px", "of an unknown curve"),
        ("four.tif --scale 0.1mm/px",
         "four.tif: expected one or three values a pixel, got an array of shape (30, 40, 4)"),
        ("huge.tif --scale 0.1mm/px", "huge.tif: expected finite numbers, got others"),
        *((f"{name}.tif --scale 0.1mm/px", f"{name}.tif: cannot be read as a TIFF") for name in ("six", "ten", "torn")),
        ("big.tif --scale 0.1mm/px", "big.tif: expected at most 120000000 pixels, got 25000 x 20000"),
        ("big.jpg --scale 0.1mm/px", "big.jpg: expected at most 120000000 pixels, got"),
        ("bigger.jpg --scale 0.1mm/px", "bigger.jpg: expected at most 120000000 pixels, got"),
        ("cut.jpg --scale 0.1mm/px", "cut.jpg: cannot be read as a picture: image file is truncated"),
        ("none.jpg --scale 0.1mm/px", "none.jpg: cannot be read as a picture: cannot identify image file"),
        ("SPOT other.tif --scale 0.1mm/px", "expected 400 x 300 pixels"),
        ("none.jpg --scale wide", "--scale must be 0.05mm/px, two points"),
        (f"none.jpg --scale 1,1:{'9' * 5000},1=10mm", "scale must have two points that are apart, on a photo"),
        ("SPOT --scale 0.1mm/px --glare 2+-2", "--glare must be a value between 0 and 1 with an error"),
        ("SPOT --scale 0.1mm/px --reflectance 0.2+-0.01", "--reflectance must be left out"),
        ("SPOT --scale 0.1mm/px --grey SPOT --reflectance 97.1", "got '97.1' (a share: 0.971 for 97.1 %)"),
        (f"SPOT --scale 0.1mm/px --surface {'9' * 5000}",
         f"--surface must be a value with its error, such as 0.02+-0.02, got '{'9' * 59}..."),
        ("SPOT --scale 0.1mm/px --beam fwhm:wide", "such as 0.5mm+-0.05mm or fwhm:0.6mm+-0.06mm, got 'fwhm:wide'"),
        ("SPOT --scale 0.1mm/px --n 3", "n = 3"),
        ("SPOT --scale 0.1mm/px --n 1.7 --g 0 --out out", "without --out the medium alone is measured"),
        ("--simulate SETUP.toml", "--out must be a folder"),
        ("--simulate SETUP.toml --scale 0.1mm/px --out out", "--scale must be left out where photographs"),
        ("SPOT --simulate SETUP.toml --out out", "SHOT must be left out"),
    ],
    ids=str,
)  # fmt: skip
def test_bad_input_is_one_line_and_writes_nothing(refused, folder, tmp_path, words, said):
    files = {path.name: str(path) for path in folder.iterdir()} | {"SPOT": several(folder, "spot")[0]}
    out = "" if "--out" in words or "--simulate" in words else " --out out"
    refused(tuple(files.get(word, word) for word in f"photo {words}{out}".split(" ")), said)
    assert not list(tmp_path.iterdir())


def test_photographs_of_another_aperture_are_refused(refused, folder, tmp_path):
    """As spot and card of another aperture would have a scale that is wrong, and no misfit."""
    for at in (0, 1):  # what was the time, 1 and 3.9 ms, is an f-number
        whole = Path(several(folder, "spot")[at]).read_bytes()
        time, number = (struct.pack("<HHI", tag, 5, 1) for tag in (33434, 33437))
        assert whole.count(time) == 1
        (tmp_path / f"spot-{at}.dng").write_bytes(whole.replace(time, number))
    for words in (("spot-0.dng", "spot-1.dng"), ("spot-0.dng", "--grey", "spot-1.dng")):
        err = refused(("photo", *words, *SCALE), "spot-1.dng")
        assert re.fullmatch(r"profilefit: spot-1.dng: expected f/0.001 as spot-0.dng has, got f/0.00\d+\n", err)


def test_files_after_an_equals_sign_are_the_options_too():
    app, seen = typer.Typer(), []

    @app.command(cls=SeveralFiles)
    def photo(shots: list[str], card: Annotated[list[str], typer.Option()]):
        seen.extend([shots, card])

    app(["one", "--card=two", "three", "--card", "four"], standalone_mode=False)
    assert seen == [["one"], ["two", "three", "four"]]


@pytest.mark.slow
def test_a_jpeg_is_read_with_a_warning(done, folder, tmp_path):
    """Of a spot that eight bits hold; the answer says that it is no measurement."""
    for name in ("spot", "grey"):
        light = linear(folder, name)[0]
        coded = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
        cv2.imwrite(str(tmp_path / f"{name}.jpg"), np.repeat((255 * coded).astype(np.uint8)[..., None], 3, axis=2))
    out = done("photo", "spot.jpg", "--grey", "grey.jpg", *SCALE)
    assert "no exposure time is stated" in " ".join(out.split())
    assert "one exposure does not tell gain" in " ".join(out.split())
    assert "eight bits, taken for sRGB: not a measurement" in " ".join(out.split())
    assert "MISFIT, for which errors are widened by a factor of" in " ".join(out.split())


def test_a_truncated_raw_file_is_one_line(folder, tmp_path, capfd):
    """LibRaw itself would write another to standard error."""
    (tmp_path / "cut.dng").write_bytes((folder / "spot-1.dng").read_bytes()[:20_000])
    with pytest.raises(InputError, match=r"cut.dng: cannot be read as a raw file: [^\n]*$"):
        read(tmp_path / "cut.dng")
    assert capfd.readouterr().err == ""
