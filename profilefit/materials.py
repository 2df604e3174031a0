"""Measured materials as data: reduced scattering and absorption of the classic table of translucent things."""

from __future__ import annotations

from dataclasses import dataclass

SOURCE = (
    "H. W. Jensen, S. R. Marschner, M. Levoy and P. Hanrahan, A practical model for subsurface light transport, "
    "SIGGRAPH 2001, table 1"
)
CHANNELS = ("red", "green", "blue")


@dataclass(frozen=True)
class Material:
    """Material with sigma_s' (`scattering`) and sigma_a (`absorption`) of red, green and blue [1/mm]."""

    name: str
    scattering: tuple[float, float, float]
    absorption: tuple[float, float, float]

    @property
    def alpha(self) -> tuple[float, ...]:
        """Reduced albedo sigma_s' / (sigma_s' + sigma_a) of each channel [-]."""
        return tuple(s / (s + a) for s, a in zip(self.scattering, self.absorption, strict=True))

    @property
    def mfp(self) -> tuple[float, ...]:
        """Mean free path 1 / (sigma_s' + sigma_a) of each channel [mm]."""
        return tuple(1.0 / (s + a) for s, a in zip(self.scattering, self.absorption, strict=True))


MATERIALS = (
    Material("apple", (2.29, 2.39, 1.97), (0.0030, 0.0034, 0.046)),
    Material("chicken1", (0.15, 0.21, 0.38), (0.015, 0.077, 0.19)),
    Material("chicken2", (0.19, 0.25, 0.32), (0.018, 0.088, 0.20)),
    Material("cream", (7.38, 5.47, 3.15), (0.0002, 0.0028, 0.0163)),
    Material("ketchup", (0.18, 0.07, 0.03), (0.061, 0.97, 1.45)),
    Material("marble", (2.19, 2.62, 3.00), (0.0021, 0.0041, 0.0071)),
    Material("potato", (0.68, 0.70, 0.55), (0.0024, 0.0090, 0.12)),
    Material("skimmilk", (0.70, 1.22, 1.90), (0.0014, 0.0025, 0.0142)),
    Material("skin1", (0.74, 0.88, 1.01), (0.032, 0.17, 0.48)),
    Material("skin2", (1.09, 1.59, 1.79), (0.013, 0.070, 0.145)),
    Material("wholemilk", (2.55, 3.21, 3.77), (0.0011, 0.0024, 0.014)),
)
BY_NAME = {material.name: material for material in MATERIALS}
