"""Files of an environment: what they say comes in, and what is no map of radiance is one line."""

import struct

import numpy as np
import pytest

from profilefit.errors import InputError
from profilefit.scenes.fur.scene import FurRequest
from profilefit.scenes.sea.scene import SeaRequest
from profilefit.scenes.skin.scene import SceneRequest
from profilefit.scenes.stage import request
from profilefit.scenes.stage.light.environment import read_map
from profilefit.scenes.stage.world import Light
from tests.fixtures import refused

cv2 = pytest.importorskip("cv2")
OpenEXR = pytest.importorskip("OpenEXR")
MORE = [{"direction": [1.0, 0.0, 0.0], "irradiance": [0.0, 0.5, 1.0]}]
MUTATIONS = 300


def gradient(rows=8):
    """Radiance (rows, 2 rows, 3) that Radiance's eight bits and EXR's halves hold."""
    columns = np.arange(2 * rows, dtype=np.float32)[None, :, None]
    return np.broadcast_to(0.5 + columns / 16.0, (rows, 2 * rows, 3)) * np.float32([1.0, 0.5, 0.25])


def written(path, values, names="RGB", kind=np.float32):
    if path.suffix == ".hdr":
        assert cv2.imwrite(str(path), np.ascontiguousarray(values[..., ::-1], np.float32))
    else:
        OpenEXR.File({"type": OpenEXR.scanlineimage}, {names: np.ascontiguousarray(values, kind)}).write(str(path))
    return path


@pytest.mark.parametrize("name", ["sky.hdr", "sky.exr", "SKY.EXR"])
def test_a_map_comes_in_as_it_is(tmp_path, name):
    np.testing.assert_allclose(read_map(written(tmp_path / name, gradient())), gradient(), rtol=0.01)


def test_halves_and_opacity_come_in(tmp_path):
    values = np.concatenate([gradient(), np.ones((8, 16, 1))], axis=-1)
    path = written(tmp_path / "sky.exr", values, "RGBA", np.float16)
    np.testing.assert_allclose(read_map(path), gradient(), rtol=1e-3)


def huge(path, columns, rows):
    path.write_bytes(f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {rows} +X {columns}\n".encode() + 64 * b"\x02\x02")
    return path


def cut(path, share):
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    return path


def with_value(path, value):
    values = np.array(gradient())
    values[3, 5, 1] = value
    return written(path, values)


def wide(path, columns, rows):
    """An EXR whose window says so, and which has the pixels of a small one."""
    content = bytearray(written(path, gradient()).read_bytes())
    for name in (b"dataWindow\0box2i\0", b"displayWindow\0box2i\0"):
        at = content.index(name) + len(name) + 4
        content[at : at + 16] = struct.pack("<4i", 0, 0, columns - 1, rows - 1)
    path.write_bytes(content)
    return path


def folder(path):
    path.mkdir()
    return path


BAD = {
    "cut.hdr": (lambda p: cut(written(p, gradient(64)), 0.6), "cut.hdr: cannot be read as a Radiance file"),
    "short.hdr": (lambda p: cut(written(p, gradient()), 0.02), "expected a Radiance file of RGBE"),
    "none.hdr": (lambda p: cut(written(p, gradient()), 0.0), "expected a file of 1 byte to 256 MiB, got 0 bytes"),
    "cut.exr": (lambda p: cut(written(p, gradient(64)), 0.6), "cut.exr: cannot be read as an EXR"),
    "short.exr": (lambda p: cut(written(p, gradient()), 0.02), "short.exr: cannot be read as an EXR"),
    "none.exr": (lambda p: cut(written(p, gradient()), 0.0), "expected a file of 1 byte to 256 MiB, got 0 bytes"),
    "nan.exr": (lambda p: with_value(p, np.nan), r"nan.exr: expected radiance in 0 \.\.\. 1e\+09, got nan"),
    "negative.exr": (lambda p: with_value(p, -0.5), r"negative.exr: expected radiance in 0 .* got -0.5"),
    "endless.exr": (lambda p: with_value(p, np.inf), "endless.exr: expected radiance in 0 .* got inf"),
    "bright.exr": (lambda p: with_value(p, 1e30), "bright.exr: expected radiance in 0 .* got 1e"),
    "huge.hdr": (lambda p: huge(p, 99999999, 49999999), "1 ... 8192 x 4096 pixels, got 99999999 x 49999999"),
    "large.hdr": (lambda p: huge(p, 16384, 8192), "1 ... 8192 x 4096 pixels, got 16384 x 8192"),
    "empty.hdr": (lambda p: huge(p, 0, 0), "1 ... 8192 x 4096 pixels, got 0 x 0"),
    "huge.exr": (lambda p: wide(p, 100000, 50000), "huge.exr: expected 1 ... 8192 x 4096 pixels, got 100000 x 50000"),
    "square.hdr": (lambda p: written(p, gradient()[:, :8]), "twice as wide as high, got 8 x 8 pixels"),
    "square.exr": (lambda p: written(p, gradient()[:, :8]), "twice as wide as high, got 8 x 8 pixels"),
    "grey.exr": (lambda p: written(p, gradient()[..., 0], "Y"), "grey.exr: expected floats of red, green and blue"),
    "whole.exr": (
        lambda p: written(p, gradient(), kind=np.uint32),
        "whole.exr: expected floats of red, green and blue, got uint32",
    ),
    "text.hdr": (lambda p: p.write_text("a sky") and p, "expected a Radiance file of RGBE"),
    "text.exr": (lambda p: p.write_text("a sky") and p, "text.exr: cannot be read as an EXR"),
    "sky.png": (lambda p: p.write_bytes(b"\x89PNG") and p, r"expected a map of radiance, .hdr or .exr, got '.png'"),
    "sky": (lambda p: p.write_bytes(b"sky") and p, "got 'no suffix'"),
    "folder.hdr": (folder, "folder.hdr: expected a file of 1 byte to 256 MiB, got no regular file"),
    "nowhere.hdr": (lambda p: p, "nowhere.hdr: cannot be read: No such file or directory"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_no_map_is_one_line(tmp_path, capfd, name):
    """It names the file and the table, and libraries say nothing beside it."""
    make, said = BAD[name]
    make(tmp_path / name)
    capfd.readouterr()
    file = str(tmp_path / "scene.toml")
    text = refused(said, SceneRequest.of, file, {"scene": "skin", "light": {"environment": name}})
    assert text.startswith(f"{file}: [light] {tmp_path / name}: ")
    assert capfd.readouterr() == ("", "")


def read_or_refused(path):
    try:
        return read_map(path), ""
    except InputError as error:
        return None, str(error)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sky.hdr", "sky.exr"])
def test_a_damaged_map_is_a_map_or_one_line(tmp_path, capfd, name):
    """Bytes changed, taken away or put in anywhere, most of them in the header."""
    whole = written(tmp_path / name, gradient(16)).read_bytes()
    random = np.random.default_rng(65)
    refusals = 0
    for _ in range(MUTATIONS):
        content = bytearray(whole)
        for _ in range(random.integers(1, 5)):
            at = int(random.integers(0, len(content) if random.random() < 0.3 else 400)) % len(content)
            match random.integers(0, 3):
                case 0:
                    content[at] = random.integers(0, 256)
                case 1:
                    del content[at : at + int(random.integers(1, 40))]
                case _:
                    content[at:at] = random.bytes(int(random.integers(1, 9)))
        path = tmp_path / f"mutated{(tmp_path / name).suffix}"
        path.write_bytes(content)
        values, error = read_or_refused(path)
        if values is None:
            assert error.isprintable()
            refusals += 1
        else:
            assert values.shape[1] == 2 * values.shape[0]
            assert np.all(np.isfinite(values) & (values >= 0))
    assert refusals > 0.2 * MUTATIONS
    assert capfd.readouterr() == ("", "")


def test_a_file_names_lamps_and_a_map(tmp_path):
    """Beside the file; turned and scaled as it says."""
    written(tmp_path / "sky.hdr", gradient())
    light = {"ambient": [0.0, 0.0, 0.0], "more": MORE, "environment": "sky.hdr", "rotation": 90.0, "scale": 2.0}
    for read in (SceneRequest, FurRequest):
        content = {"scene": read.model_fields["scene"].default, "light": light}
        table = read.of(str(tmp_path / "scene.toml"), content).light_table
        assert table.lamps == (Light((1.0, 0.0, 0.0), (0.0, 0.5, 1.0)),)
        power = 2.0 * 4.0 * np.pi * gradient().mean(axis=(0, 1))
        np.testing.assert_allclose(table.sky.power.sum(axis=0), power, rtol=0.01)
        ahead = table.sky.irradiance([(0.0, 0.0, -1.0), (0.0, 0.0, 1.0)])
        assert np.all(ahead[0] < ahead[1])  # columns grow to the right, which is turned backward


@pytest.mark.parametrize(
    ("light", "said"),
    [
        ({"more": MORE * 4}, r"\[light\] more must be at most 3 lamps beside the first, got 4"),
        ({"more": [{"direction": [0.0, 0.0, 0.0], "irradiance": [1.0, 1.0, 1.0]}]}, "a direction, not 0"),
        ({"more": [{"direction": [0.0, 0.0, 1.0]}]}, "irradiance must be three numbers in 0 ... 1000, got nothing"),
        ({"more": {"direction": [0.0, 0.0, 1.0]}}, r"tables \[\[light.more\]\]"),
        ({"rotation": 10.0}, r"\[light\] rotation must be left out where there is no environment, got 10"),
        ({"scale": 2.0}, r"\[light\] scale must be left out where there is no environment, got 2"),
        ({"environment": "sky.hdr", "scale": 0.0}, r"\[light\] scale must be a number > 0 and <= 1000000, got 0.0"),
        ({"environment": "sky.hdr", "rotation": 1e3}, r"\[light\] rotation must be a number in -360 ... 360"),
        ({"environment": ["sky.hdr"]}, r"\[light\] environment must be a map of radiance over latitude"),
        ({"irradiance": [0.0] * 3, "ambient": [0.0] * 3}, "irradiance and ambient must not both be 0"),
    ],
)
def test_mistakes_in_light(light, said):
    refused(said, SceneRequest.of, "scene.toml", {"scene": "skin", "light": light})


def test_light_of_others_is_enough():
    """No first lamp and no ambient light: another lamp makes up for both."""
    content = {"irradiance": [0.0] * 3, "ambient": [0.0] * 3, "more": MORE}
    assert not request.LightTable(**content).is_dark


def test_the_sea_has_one_sun():
    water = {"a": [0.3, 0.1, 0.08], "b": [0.1, 0.1, 0.1], "source": "assumed", "phase": [[1.0, 0.9]]}
    for key, value in (("more", MORE), ("environment", "sky.hdr")):
        said = rf"\[light\] keys must be of direction, irradiance, ambient, got '{key}'"
        refused(said, SeaRequest.of, "sea.toml", {"scene": "sea", "water": water, "light": {key: value}})
