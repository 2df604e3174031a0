"""Small scenes drawn at random from a seed, each in texture space, on the screen, and as its truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import moderngl
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from benchmarks.heart_fit import SplitLight
from profilefit.scenes.heart import meshes
from profilefit.scenes.heart.atlas import Atlas, atlas_size
from profilefit.scenes.heart.chart import occlusion_error
from profilefit.scenes.heart.law import Kernel
from profilefit.scenes.heart.passes import ATLAS, Balanced, gather_of
from profilefit.scenes.heart.truth import summed
from profilefit.scenes.stage.pattern import Sampling
from profilefit.scenes.stage.reference.surface import evenly, sees, world
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.technique import EXITANCE
from profilefit.scenes.stage.world import INSIDE, Camera, Light, Mesh, Part, Scene, unit

Floats = NDArray[np.float64]
KINDS = ("ball", "bumps", "heart")
# Of both ends of what is drawn; lengths in the kernel's mean sigma.
RADII = {"ball": (3.0, 20.0), "bumps": (5.0, 20.0), "heart": (6.0, 25.0)}  # of bumps the period
STEEPNESS = 0.05, 0.3  # amplitude of bumps, in their period
TEXELS, PIXELS, STRIPES = (0.1, 1.0), (0.08, 0.4), (2.0, 8.0)
VIEWS, LAMPS = (0.0, 65.0), (20.0, 70.0)  # degrees, of the eye from z, and of the lamp from the eye
LARGEST = 200  # pixels of a side, and texels of half of one
FINE = 10 * meshes.CHARTS_END  # texels of the truth, of a side at most
SAMPLES, CHOSEN = 64, 400
SHADOWS = 1024
LIGHT, AMBIENT = 0.9, 0.1  # irradiance of the lamp, and from everywhere: white is 1
LIT = 1.5  # irradiance of what the lamp reaches, at least, over that of what it does not


@dataclass(frozen=True)
class RandomScene:
    """A surface of one kind under a lamp, as a camera sees it, its atlas, and the kernel of its medium.

    size     radius, or period of bumps [mm];  steepness  amplitude of those, in their period
    eye, lamp  directions to them;  stripes  period of the lamp's pattern [mm], 0 for even light
    texel, pixel  mean sides [mm]
    """

    kind: str
    size: float
    steepness: float
    eye: tuple[float, float, float]
    lamp: tuple[float, float, float]
    stripes: float
    texel: float
    pixel: float
    kernel: Kernel

    @cached_property
    def mesh(self) -> Mesh:
        return meshes.surface(self.kind, self.size, self.steepness)

    @cached_property
    def camera(self) -> Camera:
        """Camera that sees all of the surface, in parallel rays."""
        half = np.max(np.linalg.norm(self.mesh.position, axis=1))
        x, y, z = (10.0 * half * unit(self.eye)).tolist()
        return Camera((x, y, z), height=2.1 * half, kind="orthographic")

    def striped(self, light: NDArray[np.floating], points: Floats) -> NDArray[np.floating]:
        """Return irradiance (..., 3) at points (..., 3) under the stripes of the lamp."""
        if self.stripes == 0:
            return light
        across = unit(np.cross(self.lamp, (0.3, 1.0, 0.2)))
        return np.where(np.mod(points @ across / self.stripes, 1.0)[..., None] < 0.5, light, AMBIENT)


def drawn(kernels: Sequence[Kernel], count: int, seed: int) -> list[RandomScene]:
    """So many trials, each of one of the kernels; lengths are drawn evenly in their logarithm."""
    random = np.random.default_rng(seed)
    found = []
    for number in range(count):
        kernel = kernels[int(random.integers(len(kernels)))]
        kind = KINDS[number % len(KINDS)]
        unit_length = mean_sigma(kernel)

        def length(ends: tuple[float, float], unit_length: float = unit_length) -> float:
            return float(unit_length * np.exp(random.uniform(*np.log(ends))))

        turn, angle = random.uniform(0.0, 2.0 * np.pi), np.radians(random.uniform(*VIEWS))
        eye = unit([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)])
        if kind != "bumps":  # a closed surface from any side
            eye = unit(random.standard_normal(3))
        lamp = _aside(eye, np.radians(random.uniform(*LAMPS)), random.uniform(0.0, 2.0 * np.pi))
        if kind == "bumps":
            lamp = unit([lamp[0], lamp[1], max(lamp[2], 0.35)])
        size = length(RADII[kind])
        found.append(
            RandomScene(
                kind,
                size,
                float(random.uniform(*STEEPNESS)),
                tuple(eye.tolist()),
                tuple(lamp.tolist()),
                length(STRIPES) if random.random() < 0.5 else 0.0,
                length(TEXELS),
                length(PIXELS),
                kernel,
            )
        )
    return found


def mean_sigma(kernel: Kernel) -> float:
    """Return the mean of sigma over the light of all channels [mm]."""
    weight = np.atleast_2d(kernel.weights.T).mean(axis=0)
    return float(weight @ np.sqrt(kernel.variances) / weight.sum())


def measured(context: moderngl.Context, trial: RandomScene, most: int = LARGEST) -> SplitLight:
    """Draw a trial in every way, and sum its truth at some hundred pixels: some seconds.

    most  pixels of a side, and texels, where they are finer
    """
    mesh, camera = trial.mesh, trial.camera
    side = int(min(np.ceil(camera.height / trial.pixel), most))
    part = Part(mesh, np.ones((1, 1, 3), np.float32))
    scene = Scene((part,), Light(trial.lamp, (LIGHT,) * 3), (AMBIENT,) * 3, camera)
    size, margin = atlas_size(mesh, trial.texel, most)
    finest, _ = atlas_size(mesh, 0.0, FINE, meshes.CHARTS_END)
    with (
        Stage(context, (side, side), SHADOWS) as stage,
        Atlas(context, size, margin) as atlas,
        Atlas(context, finest, 2) as fine,
    ):
        stage.draw(scene)
        for one in (atlas, fine):
            one.draw(stage, part)
            _lit(one, trial)
        buffers = stage.buffers()
        places = world(buffers, camera)
        light = trial.striped(buffers.irradiance, places).astype(np.float32)
        stage.upload(replace(buffers, irradiance=light))
        at = _chosen(trial, buffers.mask > INSIDE, places)
        own, elements = light[at].astype(float), fine.elements()
        truth = summed(elements, trial.kernel.variances, trial.kernel.weights, places[at], own)
        unseen = ~sees(buffers, camera, elements.points)
        lit = unseen & (elements.irradiance.max(axis=1) > LIT * AMBIENT)
        away, _ = cKDTree(elements.points[lit]).query(places[at]) if lit.any() else (np.full(1, np.inf), None)
        near, far, seen, share = _splits(stage, atlas, trial.kernel, at)
        facing = np.abs(buffers.normal[at][:, 2]).astype(float)
        return SplitLight(
            truth,
            own,
            near,
            far,
            seen,
            share,
            facing,
            atlas.texel,
            camera.height / side,
            np.sqrt(trial.kernel.variances),
            occlusion_error(elements, ~unseen, trial.kernel, places[at], own),
            float(away.min()),
        )


def _aside(eye: Floats, angle: float, turn: float) -> Floats:
    """Return a direction at an angle from another one."""
    across = unit(np.cross(eye, (0.31, 0.87, 0.39)))
    up = np.cross(eye, across)
    return np.cos(angle) * eye + np.sin(angle) * (np.cos(turn) * across + np.sin(turn) * up)


def _lit(atlas: Atlas, trial: RandomScene) -> None:
    """Multiply by the pattern of the lamp the irradiance of an atlas."""
    light, place = atlas.read("irradiance_map"), atlas.read("position_map")
    light[..., :3] = trial.striped(light[..., :3], place[..., :3].astype(float))
    atlas.renderer.write("irradiance_map", light)


def _chosen(trial: RandomScene, inside: NDArray[np.bool_], places: Floats) -> tuple[NDArray[np.intp], ...]:
    """Return some of the pixels that see the surface, away from where it ends."""
    sigma = float(np.sqrt(trial.kernel.variances[-1]))
    return evenly(inside & meshes.off_edges(trial.kind, trial.size, places, sigma), CHOSEN)


def _splits(
    stage: Stage, atlas: Atlas, kernel: Kernel, at: tuple[NDArray[np.int64], ...]
) -> tuple[Floats, Floats, Floats, Floats]:
    count, sampling, mfp = kernel.variances.size, Sampling(SAMPLES), (1.0, 1.0, 1.0)
    near, far, texture = np.zeros((3, count + 1, len(at[0]), 3))
    share = np.ones((count + 1, len(at[0])))
    for m in range(count + 1):
        parts = [Kernel(kernel.variances[one], kernel.weights[one]) for one in (slice(m), slice(m, None))]
        if m > 0:
            near[m] = stage.scatter(gather_of(parts[0], mfp), 1.0, sampling)[at] * parts[0].energy
        if m < count:
            far[m] = stage.scatter(gather_of(parts[1], mfp), 1.0, sampling)[at] * parts[1].energy
            share[m] = stage.renderer.read(EXITANCE)[at][:, 3]
            texture[m] = stage.scatter(Balanced.of(atlas, None, parts[1], 0.0, ATLAS, mfp), 1.0, sampling)[at]
    return near, far, texture, share
