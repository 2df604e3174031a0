"""Mesh of a file, GLB, glTF, OBJ, PLY or STL: parts with their textures, for a scene to draw.

trimesh reads the file, Pillow its images. Both read what others wrote, so that sizes are checked before they are read:
bytes of the file and of files beside it, numbers of accessors and nodes, triangles, pixels. What a file refers to must
lie in its folder.
"""

from __future__ import annotations

import json
import logging
import struct
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import Annotated, Any, Self
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PrivateAttr, ValidationInfo, model_validator

from mcml_sim.files.whole_file import parse_json, read_whole
from mcml_sim.media.arrays import Floats
from profilefit.errors import InputError
from profilefit.measured.photo.exposure import library, linear
from profilefit.recipes.declared import Declared, Line, OneOf, Refused, words
from profilefit.scenes.stage.world import EVEN, Mesh, Part, Singles, unit

SUFFIXES = (".glb", ".gltf", ".obj", ".ply", ".stl")
GLTF = (".glb", ".gltf")
UNITS = {"m": 1000.0, "cm": 10.0, "mm": 1.0, "in": 25.4}  # [mm]
MOST_BYTES, MOST_JSON = 200 << 20, 32 << 20
MOST_TRIANGLES, MOST_PARTS, MOST_ENTRIES = 2_000_000, 64, 4096
LISTS = "accessors", "bufferViews", "buffers", "images", "materials", "meshes", "nodes", "textures", "scenes"
MOST_SIDE, MOST_PIXELS = 8192, 1 << 25  # of a texture, and of all textures of a file
LEAST_SIZE, MOST_SIZE = 0.1, 2000.0  # of a mesh [mm]
MOST_UV = 1e3
LINEAR = linear(np.arange(256, dtype=np.uint8))
COLOUR = "_profilefit_COLOR_0"  # trimesh keeps such an attribute as it is, but rounds or loses one named COLOR_0
MESH = f"a file {', '.join(SUFFIXES)}"


@dataclass(frozen=True)
class FilePart:
    """Part of a file.

    Attributes:
        mesh: in mm, the middle of all parts in the origin.
        colour: (rows, columns, 3) linear base colour over u and v [-], or None where the file gives none.
        roughness: of GGX [-], or None.
        relief: (rows, columns, 4) of normals in the tangent plane, and roughness over the part's.
    """

    mesh: Mesh
    colour: Singles | None
    roughness: float | None
    relief: Singles

    def part(self, reflectance: Singles, roughness: float, most: float = 1.0) -> Part:
        """Return the part of a scene.

        Args:
            reflectance: A [-] where the file has no colour.
            roughness: where the file has none [-].
            most: A that the surface lets out [-].
        """
        colour = reflectance if self.colour is None else np.minimum(self.colour, np.float32(most))
        return Part(self.mesh, colour, self.roughness or roughness, relief=self.relief)


class MeshTable(Declared):
    """Table [surface]: a mesh of a file beside this one, centred in the origin; its unit, and a factor of its size.

    unit  of the file's coordinates: by default m of GLB and glTF, as their specification has it, and mm of others
    """

    mesh: Annotated[Line, words(MESH)] = ""
    unit: Annotated[str, OneOf(*UNITS)] = "mm"
    scale: Annotated[float, Field(gt=0.0, le=1e6)] = 1.0
    _parts: tuple[FilePart, ...] = PrivateAttr(())

    @property
    def parts(self) -> tuple[FilePart, ...]:
        """Parts of the file; none where there is no file."""
        return self._parts

    @property
    def extent(self) -> float:
        """Largest side of the box around the parts [mm]."""
        places = np.concatenate([part.mesh.position for part in self._parts])
        return float(np.ptp(places, axis=0).max())

    @model_validator(mode="after")
    def _read(self, info: ValidationInfo) -> Self:
        if not self.mesh:
            for key in ("unit", "scale"):
                if key in self.model_fields_set:
                    raise Refused("left out without a mesh", getattr(self, key), key)
            return self
        is_metric = self.mesh.lower().endswith(GLTF) and "unit" not in self.model_fields_set
        factor = self.scale * UNITS["m" if is_metric else self.unit]
        self._parts = read_mesh(Path(str(info.context)).parent / self.mesh, factor, self.mesh)
        return self


def read_mesh(path: Path, factor: float, name: str = "") -> tuple[FilePart, ...]:
    """Return the parts of a mesh file, scaled to mm. InputError in one line of what cannot be drawn.

    Args:
        path: of the file.
        factor: millimetres of the file's unit.
        name: of the file, for messages.
    """
    name = name or str(path)
    kind = path.suffix.lower()
    if kind not in SUFFIXES:
        raise InputError(f"mesh must be {MESH}, got {name}")
    trimesh = library("trimesh")
    folder = _Folder(path, name)
    content = folder.content(path.name)
    if kind in GLTF:
        header = _header(content, kind, name)
        _require_bounded(header, folder, name)
        with _sound(name):
            content = _renamed(content, kind, header)
    try:
        with _sound(name):
            scene = trimesh.load_scene(BytesIO(content), file_type=kind[1:], resolver=folder, process=False)
    finally:
        if folder.refused:
            raise folder.refused[0]
    with _sound(name):
        shapes = [(scene.graph[node][1], scene.graph[node][0]) for node in scene.graph.nodes_geometry]
        shapes = [(scene.geometry[key], matrix) for key, matrix in shapes]
        shapes = [(one, matrix) for one, matrix in shapes if isinstance(one, trimesh.Trimesh) and len(one.faces)]
    count = sum(len(one.faces) for one, _ in shapes)
    if not 0 < count <= MOST_TRIANGLES:
        raise InputError(f"mesh must have 1 ... {MOST_TRIANGLES} triangles, got {count} in {name}")
    if len(shapes) > MOST_PARTS:
        raise InputError(f"mesh must have {MOST_PARTS} parts at most, got {len(shapes)} in {name}")
    painter = _Painter(name)
    parts = []
    for one, matrix in shapes:
        with _sound(name):
            mesh = _mesh(one, np.asarray(matrix, float), kind, name)
            colour, roughness, relief = painter.surface(getattr(one.visual, "material", None))
            if colour is None and mesh.tint is not None:
                colour = np.ones((1, 1, 3), np.float32)
        parts.append(FilePart(mesh, colour, roughness, relief))
    return _placed(parts, factor, name)


def _placed(parts: list[FilePart], factor: float, name: str) -> tuple[FilePart, ...]:
    """Return parts in mm, about the middle of the box around all of them."""
    ends = np.array([[part.mesh.position.min(axis=0), part.mesh.position.max(axis=0)] for part in parts])
    low, high = ends[:, 0].min(axis=0), ends[:, 1].max(axis=0)
    size = factor * float(np.max(high - low))
    if not LEAST_SIZE <= size <= MOST_SIZE:
        accepted = f"{LEAST_SIZE:g} ... {MOST_SIZE:g} mm large, by unit and scale"
        raise InputError(f"mesh must be {accepted}, got {size:.4g} mm of {name}")

    meshes = (replace(part.mesh, position=factor * (part.mesh.position - 0.5 * (low + high))) for part in parts)
    return tuple(replace(part, mesh=mesh) for part, mesh in zip(parts, meshes, strict=True))


def _mesh(shape: Any, matrix: Floats, kind: str, name: str) -> Mesh:
    """Return a mesh of trimesh's in its place, without what has no area."""
    position, triangles = np.asarray(shape.vertices, float) @ matrix[:3, :3].T + matrix[:3, 3], np.asarray(shape.faces)
    if not np.all(np.isfinite(position)):
        raise InputError(f"mesh must have finite coordinates, got others in {name}")
    if triangles.min() < 0 or triangles.max() >= len(position):
        raise InputError(f"mesh must have triangles of its {len(position)} vertices, got others in {name}")
    if kind == ".stl":  # each triangle has vertices of its own, which have no normal but its
        shape.merge_vertices()
        position, triangles = np.asarray(shape.vertices, float), np.asarray(shape.faces)
    face = _crosses(position, triangles)
    area = np.linalg.norm(face, axis=1)
    good = area > 1e-12 * area.max()
    if not good.any():
        raise InputError(f"mesh must have an area, got none in {name}")
    used, numbers = np.unique(triangles[good], return_inverse=True)
    triangles = numbers.reshape(-1, 3).astype(np.int32)
    position, normal = position[used], np.asarray(shape.vertex_normals, float)[used] @ np.linalg.inv(matrix[:3, :3])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    of_face = np.empty_like(position)
    of_face[triangles.ravel()] = np.repeat(face[good], 3, axis=0)
    normal = unit(np.where((length > 1e-6) & np.isfinite(length), normal, of_face))
    if np.sum((position - position.mean(axis=0)) * normal) < 0:  # inside out
        normal = -normal
    uv, tint = _uv(shape, used, name), _tint(shape, used, kind, name)
    if uv is None:
        return Mesh(position, normal, np.zeros((len(position), 2)), triangles, tint=tint)
    mesh = Mesh(position, normal, uv, triangles, tint=tint)
    return replace(mesh, tangent=_tangents(mesh))


def _crosses(position: Floats, triangles: NDArray[np.int64]) -> Floats:
    a, b, c = (position[triangles[:, corner]] for corner in range(3))
    return np.cross(b - a, c - a)


def _tangents(mesh: Mesh) -> Floats:
    """Return (n, 4): unit directions in which u grows, and 1 or -1, by which v grows along normal x tangent."""
    a, b, c = (mesh.position[mesh.triangles[:, corner]] for corner in range(3))
    p, q, r = (mesh.uv[mesh.triangles[:, corner]] for corner in range(3))
    (du, dv), (eu, ev) = (q - p).T, (r - p).T
    turn = np.sign(du * ev - dv * eu)
    along = turn[:, None] * ((b - a) * ev[:, None] - (c - a) * dv[:, None])
    across = turn[:, None] * ((c - a) * du[:, None] - (b - a) * eu[:, None])
    total = np.zeros((2, *mesh.position.shape))
    for corner in range(3):
        np.add.at(total[0], mesh.triangles[:, corner], along)
        np.add.at(total[1], mesh.triangles[:, corner], across)
    first = total[0] - np.sum(total[0] * mesh.normal, axis=1, keepdims=True) * mesh.normal
    length = np.linalg.norm(first, axis=1, keepdims=True)
    first = np.where(length > 0, first / np.where(length > 0, length, 1.0), 0.0)
    hand = np.sign(np.sum(np.cross(mesh.normal, first) * total[1], axis=1, keepdims=True))
    return np.concatenate([first, np.where(hand < 0, -1.0, 1.0)], axis=1)


def _uv(shape: Any, used: NDArray[np.int64], name: str) -> Floats | None:
    uv = getattr(shape.visual, "uv", None)
    if uv is None or np.shape(uv) != (len(shape.vertices), 2):
        return None
    found = np.asarray(uv, float)[used]
    if not np.all(np.abs(found) <= MOST_UV):
        raise InputError(f"mesh must have uv in {-MOST_UV:g} ... {MOST_UV:g}, got others in {name}")
    return found


def _tint(shape: Any, used: NDArray[np.int64], kind: str, name: str) -> Floats | None:
    """Return colours of vertices, linear: those of glTF are, others are taken for sRGB. InputError."""
    if kind in GLTF:
        if (colours := shape.vertex_attributes.get(COLOUR)) is None:
            return None
        most = np.iinfo(colours.dtype).max if colours.dtype.kind == "u" else 1.0
        is_sound = len(colours) == len(shape.vertices) and colours.shape[1:] in ((3,), (4,))
        share = colours[used, :3] / most if is_sound else np.array(np.nan)
        if not np.all(np.isfinite(share)):
            raise InputError(f"mesh must have three or four finite values of COLOR_0 a vertex, got others in {name}")
        return np.clip(share.astype(float), 0.0, 1.0)
    if shape.visual.kind != "vertex":
        return None
    kept = shape.metadata.get("_ply_raw", {}).get("vertex", {}).get("properties", {}).get("red", "u1")
    if np.dtype(kept).kind != "f" and np.dtype(kept).itemsize > 1:  # which trimesh takes for 8 bits
        raise InputError(f"mesh must have colours of vertices of 8 bits or floats, got {np.dtype(kept)} in {name}")
    return LINEAR[np.asarray(shape.visual.vertex_colors)[used, :3]].astype(float)


class _Painter:
    """Reader of materials, which share images."""

    def __init__(self, name: str):
        self.name, self.pixels = name, 0
        self._known: dict[int, tuple[object, NDArray[np.uint8]]] = {}

    def surface(self, material: Any) -> tuple[Singles | None, float | None, Singles]:
        """Return the colour, the roughness and the relief of a material."""
        if material is None:
            return None, None, EVEN
        image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
        factor = getattr(material, "baseColorFactor", None)
        tint = np.ones(3) if factor is None else np.asarray(factor, float).ravel()[:3] / 255.0
        colour = None
        if image is not None:
            colour = LINEAR[self._image(image)] * tint.astype(np.float32)
        elif factor is not None:
            colour = tint.astype(np.float32).reshape(1, 1, 3)
        rough = getattr(material, "roughnessFactor", None)
        roughness = None if rough is None else float(np.clip(rough, 0.05, 1.0))
        return colour, roughness, self._relief(material)

    def _relief(self, material: Any) -> Singles:
        bumps, rough = (getattr(material, key, None) for key in ("normalTexture", "metallicRoughnessTexture"))
        normal = EVEN[..., :3] if bumps is None else self._image(bumps).astype(np.float32) / 127.5 - 1.0
        share = EVEN[..., 3:] if rough is None else self._image(rough)[..., 1:2].astype(np.float32) / 255.0
        rows, columns = (max(sides) for sides in zip(normal.shape[:2], share.shape[:2], strict=True))

        def resized(image: Singles) -> Singles:
            at = [np.arange(new) * old // new for new, old in zip((rows, columns), image.shape, strict=False)]
            return image[np.ix_(*at)]

        return np.concatenate([resized(normal), resized(share)], axis=-1)

    def _image(self, image: Any) -> NDArray[np.uint8]:
        """Return 8-bit values (rows, columns, 3), row 0 at the bottom."""
        if id(image) not in self._known:
            columns, rows = image.size
            self.pixels += columns * rows
            if max(columns, rows) > MOST_SIDE or self.pixels > MOST_PIXELS:
                accepted = f"{MOST_SIDE} pixels of a side, and {MOST_PIXELS} in all"
                raise InputError(f"textures must have at most {accepted}, got {columns} x {rows} in {self.name}")
            self._known[id(image)] = image, np.asarray(image.convert("RGB"))[::-1]
        return self._known[id(image)][1]


class _Folder(Mapping[str, bytes]):
    """Folder of a mesh file, out of which nothing is read; trimesh finds files by their names in it."""

    def __init__(self, path: Path, name: str):
        self.folder, self.name, self.read = path.parent, name, 0
        self.refused: list[InputError] = []  # of files that trimesh would go on without

    def content(self, given: str) -> bytes:
        """Return the content of a file in the folder. InputError."""
        told = self.name if given == Path(self.name).name else f"{given!r} of {self.name}"
        try:
            path = (self.folder / unquote(given)).resolve(strict=True)
            inside = path.is_relative_to(self.folder.resolve()) and path.is_file()
            size = path.stat().st_size if inside else 0
        except (OSError, ValueError, RuntimeError) as error:
            raise InputError(f"mesh must be {MESH}, got {told}: {getattr(error, 'strerror', None) or error}") from None
        if not inside:
            raise InputError(f"mesh must have all its files in its folder, got {told}")
        self.read += size
        if not 0 < size <= MOST_BYTES or self.read > MOST_BYTES:
            raise InputError(f"mesh must have 1 byte to {MOST_BYTES >> 20} MiB in all, got {size} bytes of {told}")
        return read_whole(path, MOST_BYTES)

    def __getitem__(self, given: str) -> bytes:
        try:
            return self.content(given.strip())
        except InputError as error:
            self.refused.append(error)
            raise

    def __iter__(self) -> Iterator[str]:
        return iter(())

    def __len__(self) -> int:
        return 0


def _header(content: bytes, kind: str, name: str) -> dict[str, Any]:
    """Return the JSON of a glTF or GLB file."""
    text = content
    if kind == ".glb":
        if len(content) < 20 or content[:4] != b"glTF":
            raise InputError(f"mesh must be a GLB file, got {name}, which is none")
        (length,) = struct.unpack("<I", content[12:16])
        text = content[20 : 20 + length]
    try:
        header = parse_json(text.rstrip(b" \0"), MOST_JSON)
    except ValueError as error:
        raise InputError(f"mesh must be glTF, got {name}: {error}") from None
    if not isinstance(header, dict):
        raise InputError(f"mesh must be glTF, got {name}, whose JSON is no table")
    return header


def _renamed(content: bytes, kind: str, header: dict[str, Any]) -> bytes:
    """Return a glTF or GLB file whose attributes COLOR_0 are named COLOUR; `header` is its JSON, which is changed."""
    every = [one["attributes"] for mesh in header.get("meshes", []) for one in mesh["primitives"]]
    coloured = [attributes for attributes in every if "COLOR_0" in attributes]
    if not coloured:
        return content
    for attributes in coloured:
        attributes[COLOUR] = attributes.pop("COLOR_0")
    text = json.dumps(header).encode()
    if kind == ".gltf":
        return text
    text += b" " * (-len(text) % 4)
    rest = content[20 + struct.unpack("<I", content[12:16])[0] :]
    return content[:8] + struct.pack("<II4s", 20 + len(text) + len(rest), len(text), b"JSON") + text + rest


def _require_bounded(header: dict[str, Any], folder: _Folder, name: str) -> None:
    """Raise InputError where a glTF file would need too much, or refers to files that cannot be read."""
    for key in LISTS:
        entries = header.get(key, [])
        is_list = isinstance(entries, list) and len(entries) <= MOST_ENTRIES
        if not is_list or not all(isinstance(entry, dict) for entry in entries):
            raise InputError(f"mesh must have a list of at most {MOST_ENTRIES} {key}, got another in {name}")
    counts = [one.get("count") for one in header.get("accessors", [])]
    if not all(isinstance(count, int) and 0 <= count <= 3 * MOST_TRIANGLES for count in counts):
        raise InputError(f"mesh must have at most {3 * MOST_TRIANGLES} values an accessor, got more in {name}")
    if sum(counts) > 8 * MOST_TRIANGLES:
        raise InputError(f"mesh must have at most {8 * MOST_TRIANGLES} values, got {sum(counts)} in {name}")
    for one in (*header.get("buffers", []), *header.get("images", [])):
        uri = one.get("uri")
        if uri is not None and not (isinstance(uri, str) and uri.startswith("data:")):
            folder.content(str(uri))
    folder.read = 0
    if header.get("extensionsRequired"):
        raise InputError(f"mesh must be without required extensions, got {header['extensionsRequired']!r} in {name}")


class _Heard(logging.Handler):
    """Messages of trimesh, which goes on without an image that it cannot read."""

    def __init__(self) -> None:
        super().__init__(logging.DEBUG)
        self.messages: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.messages.append(record.getMessage())


@contextmanager
def _sound(name: str) -> Iterator[None]:
    """Raise InputError in one line whatever trimesh and Pillow raise at a damaged file, and hide what they print."""
    logger, heard = logging.getLogger("trimesh"), _Heard()
    before = logger.level, logger.propagate
    logger.addHandler(heard)
    logger.setLevel(logging.DEBUG)
    logger.propagate = False
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            yield
    except InputError:
        raise
    except Exception as error:
        told = " ".join(str(error).split())[:120] or type(error).__name__
        raise InputError(f"mesh must be {MESH}, got {name}, which is damaged: {told}") from None
    finally:
        logger.removeHandler(heard)
        logger.setLevel(before[0])
        logger.propagate = before[1]
    if any("image" in message for message in heard.messages):
        raise InputError(f"textures must be PNG or JPEG files that can be read, got others in {name}")
