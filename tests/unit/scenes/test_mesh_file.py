"""Mesh files: the same ball from every format, units, normals, textures; forty kinds of bad ones in one line each."""

import json
import os
import struct
import sys
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from mcml_sim.files.whole_file import read_toml
from profilefit.errors import InputError
from profilefit.scenes import SCENES
from profilefit.scenes.skin import scene as skin
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.subject import mesh_file
from profilefit.scenes.stage.subject.mesh_file import read_mesh
from profilefit.scenes.stage.world import Camera, Scene
from tests.fixtures import EXAMPLES

BALL = trimesh.creation.icosphere(2, 10.0)
FORMATS = "glb", "gltf", "obj", "ply", "stl"


def write(folder: Path, kind: str, mesh: trimesh.Trimesh = BALL, name: str = "ball") -> Path:
    path = folder / f"{name}.{kind}"
    made = mesh.export(file_type=kind)
    if isinstance(made, dict):  # of glTF, whose buffers are files of their own
        for key, content in made.items():
            (folder / key).write_bytes(content)
        (folder / "model.gltf").rename(path)
    else:
        path.write_bytes(made.encode() if isinstance(made, str) else bytes(made))
    return path


def textured(colour: Image.Image, **more: object) -> trimesh.Trimesh:
    """Return a square in z = 0 that faces +z, u along x and v along y."""
    square = trimesh.Trimesh([[0, 0, 0], [20, 0, 0], [20, 20, 0], [0, 20, 0]], [[0, 1, 2], [0, 2, 3]], process=False)
    look = trimesh.visual.material.PBRMaterial(baseColorTexture=colour, **more)
    square.visual = trimesh.visual.TextureVisuals(uv=[[0, 0], [1, 0], [1, 1], [0, 1]], material=look)
    return square


def solid(*colour: int, side: int = 4) -> Image.Image:
    return Image.new("RGB", (side, side), colour)


@pytest.mark.parametrize("kind", FORMATS)
def test_a_ball_of_every_format(tmp_path, kind):
    [part] = read_mesh(write(tmp_path, kind), 2.0)
    np.testing.assert_allclose(np.linalg.norm(part.mesh.position, axis=1), 20.0, rtol=1e-6)
    np.testing.assert_allclose(part.mesh.normal, part.mesh.position / 20.0, atol=0.03)
    assert len(part.mesh.position) == len(BALL.vertices)
    assert len(part.mesh.triangles) == len(BALL.faces)
    assert part.colour is None


@pytest.mark.parametrize("kind", ["obj", "stl"])
def test_inside_out_is_turned(tmp_path, kind):
    inside = BALL.copy()
    inside.invert()
    [part] = read_mesh(write(tmp_path, kind, inside), 1.0)
    assert np.min(np.sum(part.mesh.normal * part.mesh.position, axis=1)) > 9.9


def test_parts_are_moved_and_their_middle_is_the_origin(tmp_path):
    scene = trimesh.Scene([BALL])
    scene.add_geometry(BALL, transform=trimesh.transformations.translation_matrix([40.0, 0.0, 0.0]))
    parts = read_mesh(write(tmp_path, "glb", scene), 1.0)
    assert sorted(np.round(part.mesh.position.mean(axis=0), 6).tolist() for part in parts) == [[-20, 0, 0], [20, 0, 0]]


def test_colours_are_linear_and_a_relief_has_a_tangent(tmp_path):
    look = {"normalTexture": solid(128, 128, 255), "metallicRoughnessTexture": solid(0, 51, 0), "roughnessFactor": 0.5}
    path = write(tmp_path, "glb", textured(solid(188, 255, 0), baseColorFactor=[255, 255, 255, 255], **look))
    [part] = read_mesh(path, 1.0)
    np.testing.assert_allclose(part.colour[0, 0], [0.502886, 1.0, 0.0], atol=1e-6)  # IEC 61966-2-1 of 188
    assert part.roughness == 0.5
    np.testing.assert_allclose(part.relief[0, 0], [0.0, 0.0, 1.0, 0.2], atol=0.005)
    np.testing.assert_allclose(part.mesh.tangent, np.tile([1.0, 0.0, 0.0, 1.0], (4, 1)), atol=1e-12)
    upside = Image.new("RGB", (1, 2), (255, 255, 255))
    upside.putpixel((0, 1), (0, 0, 0))  # the last row of an image is at v = 0
    [part] = read_mesh(write(tmp_path, "glb", textured(upside)), 1.0)
    assert part.colour[:, 0, 0].tolist() == [0.0, 1.0]


@pytest.mark.parametrize(("kind", "expected"), [("glb", 128 / 255), ("ply", 0.215861), ("obj", 0.215861)])
def test_colours_of_vertices(context, tmp_path, kind, expected):
    """Linear in glTF, else sRGB's 128; a picture shows what lies between them, times the texture."""
    square = textured(solid(255, 255, 255))
    square = trimesh.Trimesh(square.vertices, square.faces, process=False)
    square.visual.vertex_colors = [[128, 0, 0, 255], [255, 0, 0, 255], [255, 255, 0, 255], [128, 255, 0, 255]]
    [part] = read_mesh(write(tmp_path, kind, square), 1.0)
    assert part.colour.tolist() == [[[1.0, 1.0, 1.0]]]
    at = np.argsort(part.mesh.position @ [1.0, 10.0, 0.0])  # rows from below, from the left
    expected = np.array([[expected, 0, 0], [1, 0, 0], [expected, 1, 0], [1, 1, 0]])
    np.testing.assert_allclose(part.mesh.tint[at], expected, atol=1e-6)
    half = part.part(np.zeros((1, 1, 3), np.float32), 0.5)
    half = replace(half, reflectance=np.full((1, 1, 3), 0.5, np.float32))
    with Stage(context, (40, 40), shadow_side=16) as stage:
        stage.draw(Scene((half,), camera=Camera((0.0, 0.0, 100.0), height=20.0, kind="orthographic")))
        seen = stage.buffers().reflectance
    x = (np.arange(40) + 0.5) / 40.0
    np.testing.assert_allclose(seen[..., 1], np.broadcast_to(0.5 * x[:, None], (40, 40)), atol=2e-3)
    across = expected[0, 0] + (1.0 - expected[0, 0]) * x
    np.testing.assert_allclose(seen[..., 0], np.broadcast_to(0.5 * across, (40, 40)), atol=2e-3)


CODES = {np.uint8: 255, np.uint16: 65535, np.float32: 1}  # of glTF's colours, and which is 1


def coloured(folder: Path, values: np.ndarray, has_material: bool) -> Path:
    """Write a square whose COLOR_0 has these values: trimesh itself writes 8 bits alone."""
    square = textured(solid(255, 255, 255))
    if not has_material:
        square = trimesh.Trimesh(square.vertices, square.faces, process=False)
    square.vertex_attributes["_C"] = values
    path = write(folder, "glb", square)

    def renamed(content):
        [primitive] = content["meshes"][0]["primitives"]
        primitive["attributes"]["COLOR_0"] = primitive["attributes"].pop("_C")

    header(path, renamed)
    return path


def replaced(path: Path, value: float, by: float) -> Path:
    """Change a number in the buffers of a file, whose JSON cannot hold NaN."""
    path.write_bytes(path.read_bytes().replace(struct.pack("<f", value), struct.pack("<f", by)))
    return path


@pytest.mark.parametrize("has_material", [True, False])
@pytest.mark.parametrize("code", CODES)
def test_colours_of_vertices_in_every_code_of_gltf(tmp_path, code, has_material):
    """Beside a material or not, and as fine as the file has them: trimesh makes 8 bits of them, or none."""
    given = np.array([[0.5, 0.0, 0.0], [0.01, 0.02, 0.003], [1.0, 1.0, 0.0], [0.0, 0.25, 1.0]])
    values = np.concatenate([given, np.ones((4, 1))], axis=1) * CODES[code]
    values = values.astype(code) if code == np.float32 else np.round(values).astype(code)
    [part] = read_mesh(coloured(tmp_path, values, has_material), 1.0)
    assert part.colour.reshape(-1, 3).min() == 1.0
    np.testing.assert_allclose(part.mesh.tint, given, atol=1e-7 if code == np.float32 else 0.51 / CODES[code])


def test_units_and_cameras(tmp_path):
    write(tmp_path, "glb", BALL.copy().apply_scale(0.01))
    write(tmp_path, "stl")
    file = str(tmp_path / "one.toml")

    def request(**surface):
        return skin.read(file, {"scene": "skin", "surface": surface})

    assert request(mesh="ball.glb").surface.extent == pytest.approx(200.0)  # metres, by the format's specification
    assert request(mesh="ball.glb", unit="cm", scale=2.0).surface.extent == pytest.approx(4.0)
    assert request(mesh="ball.stl").surface.extent == pytest.approx(20.0)
    camera = request(mesh="ball.stl").camera
    assert camera.target == (0.0, 0.0, 0.0)
    assert 20.0 < camera.height < 30.0


def header(path: Path, change) -> None:
    """Change the JSON of a GLB."""
    data = path.read_bytes()
    (length,) = struct.unpack("<I", data[12:16])
    content = json.loads(data[20 : 20 + length])
    change(content)
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + length :]
    path.write_bytes(data[:8] + struct.pack("<III", 20 + len(text) + len(rest), len(text), 0x4E4F534A) + text + rest)


def glb(change):
    def make(folder):
        path = write(folder, "glb", textured(solid(9, 9, 9)))
        header(path, change)
        return path

    return make


def raw(kind, content):
    def make(folder):
        path = folder / f"one.{kind}"
        path.write_bytes(content)
        return path

    return make


def shape(vertices, faces, kind="obj"):
    text = "".join(f"v {' '.join(map(str, v))}\n" for v in vertices) + "".join(
        f"f {' '.join(map(str, f))}\n" for f in faces
    )
    return raw(kind, text.encode())


def at(entry, key, value):
    return glb(lambda content: content[entry][0].__setitem__(key, value))


def linked(folder):
    outside = folder.parent / "outside.mtl"
    outside.write_text("newmtl a\n", encoding="utf-8")
    os.symlink(outside, folder / "in.mtl")
    return raw("obj", b"mtllib in.mtl\nv 0 0 0\nv 9 0 0\nv 0 9 0\nf 1 2 3\n")(folder)


def pipe(folder):
    os.mkfifo(folder / "one.ply")
    return folder / "one.ply"


def large(folder):
    path = folder / "one.stl"
    with path.open("wb") as file:
        file.truncate(mesh_file.MOST_BYTES + 1)
    return path


def many_parts(folder):
    tetrahedron = trimesh.creation.box((1, 1, 1))
    scene = trimesh.Scene()
    for number in range(mesh_file.MOST_PARTS + 1):
        scene.add_geometry(tetrahedron, transform=trimesh.transformations.translation_matrix([2.0 * number, 0, 0]))
    return write(folder, "glb", scene)


def many_instances(content):
    content["nodes"] = [{"mesh": 0, "name": str(number)} for number in range(4000)]
    content["scenes"] = [{"nodes": list(range(4000))}]


def cyclic(content):
    content["nodes"] = [{"children": [1]}, {"children": [0], "mesh": 0}]
    content["scenes"] = [{"nodes": [0]}]


def wide_texture(folder):
    return write(folder, "glb", textured(Image.new("RGB", (mesh_file.MOST_SIDE + 1, 1))))


def bomb(folder):
    """A PNG whose header says 60,000 x 60,000 pixels."""
    path = write(folder, "glb", textured(solid(1, 2, 3)))
    data = path.read_bytes()
    place = data.index(b"IHDR")
    (folder / path.name).write_bytes(data[: place + 4] + struct.pack(">II", 60000, 60000) + data[place + 12 :])
    return path


TRIANGLE = [[0, 0, 0], [9, 0, 0], [0, 9, 0]]
BAD = {
    "no file": (lambda folder: folder / "none.obj", "No such file"),
    "a folder": (lambda folder: (folder / "one.obj").mkdir() or folder / "one.obj", "in its folder"),
    "a pipe": (pipe, "in its folder"),
    "another format": (raw("fbx", b"x"), "must be a file .glb, .gltf, .obj, .ply, .stl"),
    "no suffix": (raw("", b"x"), "must be a file .glb"),
    "empty": (raw("glb", b""), "1 byte to 200 MiB"),
    "too large": (large, "1 byte to 200 MiB"),
    "text as GLB": (raw("glb", b"solid ball and more text"), "must be a GLB file"),
    "GLB of its head alone": (raw("glb", b"glTF" + bytes(16)), "must be glTF"),
    "JSON that is none": (raw("gltf", b"{"), "must be glTF"),
    "JSON of a list": (raw("gltf", b"[1, 2]"), "no table"),
    "glTF of nothing": (raw("gltf", b"{}"), "triangles, got 0"),
    "deep JSON": (raw("gltf", b"[" * 10000), "must be glTF"),
    "GLB cut off": (lambda folder: raw("glb", write(folder, "glb").read_bytes()[:900])(folder), "damaged"),
    "an accessor of a billion": (at("accessors", "count", 10**9), "values an accessor"),
    "an accessor of -1": (at("accessors", "count", -1), "values an accessor"),
    "an accessor of true": (at("accessors", "count", "7"), "values an accessor"),
    "a view beyond its buffer": (at("bufferViews", "byteLength", 10**6), "damaged"),
    "a buffer over the net": (at("buffers", "uri", "https://example.org/a.bin"), "No such file"),
    "a buffer elsewhere": (at("buffers", "uri", "/etc/passwd"), "in its folder"),
    "a buffer above": (at("buffers", "uri", "../../../../../../etc/passwd"), "in its folder"),
    "an image elsewhere": (at("images", "uri", "/etc/passwd"), "in its folder"),
    "an image that is none": (at("images", "bufferView", 0), "PNG or JPEG"),
    "a required extension": (
        glb(lambda content: content.__setitem__("extensionsRequired", ["KHR_draco_mesh_compression"])),
        "without required extensions",
    ),
    "too many nodes": (glb(lambda c: c.__setitem__("nodes", [{}] * 5000)), "at most 4096 nodes"),
    "nodes that are numbers": (glb(lambda c: c.__setitem__("nodes", [1, 2])), "at most 4096 nodes"),
    "a cycle of nodes": (glb(cyclic), "damaged"),
    "many instances": (glb(many_instances), "64 parts at most"),
    "many parts": (many_parts, "64 parts at most"),
    "a wide texture": (wide_texture, "8192 pixels of a side"),
    "a texture that unpacks": (bomb, "PNG or JPEG"),
    "a colour that is not finite": (
        lambda folder: replaced(coloured(folder, np.full((4, 4), 0.123, np.float32), True), 0.123, np.nan),
        "finite values of COLOR_0",
    ),
    "colours of too few values": (
        lambda folder: coloured(folder, np.ones((4, 2), np.float32), True),
        "three or four finite values of COLOR_0",
    ),
    "colours of 16 bits in a PLY": (
        raw(
            "ply",
            trimesh.Trimesh(BALL.vertices, BALL.faces, vertex_colors=[9, 9, 9])
            .export(file_type="ply", encoding="ascii")
            .replace(b"property uchar red", b"property ushort red"),
        ),
        "8 bits or floats, got uint16",
    ),
    "no triangles": (shape(TRIANGLE, []), "1 ... 2000000 triangles"),
    "points alone": (raw("ply", trimesh.PointCloud(BALL.vertices).export(file_type="ply")), "triangles, got 0"),
    "NaN": (shape([["nan", 0, 0], *TRIANGLE[1:]], [[1, 2, 3]]), "finite coordinates"),
    "infinite": (shape([["1e999", 0, 0], *TRIANGLE[1:]], [[1, 2, 3]]), "finite coordinates"),
    "no area": (shape([[0, 0, 0], [1, 1, 1], [2, 2, 2]], [[1, 2, 3]]), "an area, got none"),
    "one point thrice": (shape([[5, 5, 5]] * 3, [[1, 2, 3]]), "an area, got none"),
    "a vertex that is not there": (shape(TRIANGLE, [[1, 2, 9]]), "damaged"),
    "a galaxy": (shape([[1e20 * x for x in v] for v in TRIANGLE], [[1, 2, 3]]), "0.1 ... 2000 mm large"),
    "an atom": (shape([[1e-9 * x for x in v] for v in TRIANGLE], [[1, 2, 3]]), "0.1 ... 2000 mm large"),
    "a material elsewhere": (raw("obj", b"mtllib /etc/passwd\nv 0 0 0\nv 9 0 0\nv 0 9 0\nf 1 2 3\n"), "in its folder"),
    "a material that is missing": (raw("obj", b"mtllib a.mtl\nv 0 0 0\nv 9 0 0\nv 0 9 0\nf 1 2 3\n"), "No such file"),
    "a link that leads out": (linked, "in its folder"),
    "a PLY of a billion": (
        raw("ply", b"ply\nformat binary_little_endian 1.0\nelement vertex 1000000000\nproperty float x\nend_header\n"),
        "damaged",
    ),
    "an STL of a billion": (raw("stl", bytes(80) + struct.pack("<I", 10**9) + bytes(50)), "triangles, got 0"),
}


@pytest.mark.parametrize("kind", BAD)
def test_bad_files_are_one_line(tmp_path, kind):
    make, words = BAD[kind]
    folder = tmp_path / "in"
    folder.mkdir()
    with pytest.raises(InputError) as refused:
        read_mesh(make(folder), 1.0, "one")
    assert len(str(refused.value).splitlines()) == 1
    assert words in str(refused.value)


def test_there_are_forty_kinds():
    assert len(BAD) >= 40


def test_what_scenes_refuse(tmp_path):
    write(tmp_path, "stl")
    file = tmp_path / "one.toml"

    def told(text):
        file.write_text(text, encoding="utf-8")
        content = read_toml(file)
        with pytest.raises(InputError) as refused:
            import_module(SCENES[content["scene"]][0]).read(str(file), content)
        assert len(str(refused.value).splitlines()) == 1
        return str(refused.value)

    head = 'scene = "skin"\n[surface]\n'
    assert "[surface] unit must be left out without a mesh, got 'mm'" in told(head + 'unit = "mm"\n')
    assert "[surface] scale must be " in told(head + 'mesh = "ball.stl"\nscale = -1.0\n')
    assert "[surface] mesh must be 0.1 ... 2000 mm large" in told(head + 'mesh = "ball.stl"\nunit = "m"\n')
    assert "outside the mesh" in told(head + 'mesh = "ball.stl"\nscale = 90.0\n[camera]\ndistance = 700.0\n')
    layered, walls = (Path(EXAMPLES[name]).read_text(encoding="utf-8") for name in ("layers-head.toml", "heart.toml"))
    assert "pose must be left out of a mesh of a file" in told(layered + '\n[surface]\nmesh = "ball.stl"\n')
    walls = walls.replace("[surface]\n", '[surface]\nmesh = "ball.stl"\n')
    assert "[surface] kind must be left out where there is a mesh" in told(walls)
    walls = "\n".join(
        line for line in walls.splitlines() if not line.startswith(('kind = "heart"', "size =", "paint ="))
    )
    assert "[surface] triangles must have an area in the atlas, got 0" in told(walls)


def test_a_scene_without_the_package_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(InputError, match="pip install trimesh"):
        read_mesh(write(tmp_path, "stl"), 1.0)
