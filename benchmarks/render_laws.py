"""Techniques that the render compares, and how each looks in every chart."""

from __future__ import annotations

from dataclasses import dataclass, replace

import profilefit
from mcml_sim import Setting
from profilefit.laws.base import ProfileLaw
from profilefit.report.figures.canvas import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION
from profilefit.scenes.skin.passes import SeparableFilter
from profilefit.scenes.stage.pattern import Sampling

Law = ProfileLaw | SeparableFilter
OPEN = "s"


@dataclass(frozen=True)
class Contender:
    """Law and how its radii are drawn; of `sampling` the samples and the seed are set anew."""

    label: str
    law: Law
    sampling: Sampling = Sampling()  # noqa: RUF009  (frozen)
    colour: str = BLACK
    marker: str = "o"
    dashes: str = "-"

    @property
    def is_filter(self) -> bool:
        """Whether it draws nothing: its samples are taps, and every seed is the same picture."""
        return isinstance(self.law, SeparableFilter)

    @property
    def size(self) -> float:
        """Size of a marker [points]: open ones stand around those of a law that is as good."""
        return 7.5 if self.marker == OPEN else 4.5

    @property
    def face(self) -> str:
        return "none" if self.marker == OPEN else self.colour

    def drawn(self, samples: int, seed: int = 0) -> Sampling:
        return replace(self.sampling, samples=samples, seed=seed)


# Key, label, name and constants of the law, its light, colour, marker, dashes. Laws of searchlights get the same
# diffuse irradiance as the others, as in Liang et al.: their alpha is that which shows the same A under a searchlight.
WANTED = (
    ("hazard", "hazard", "hazard", "regenerated", "diffuse", BLUE, "o", "-"),
    ("quantile", "quantile", "quantile", "regenerated", "diffuse", SKY, "s", "-"),
    ("burley refitted", "normalized diffusion, refitted", "burley", "regenerated", "diffuse", GREEN, "^", "-"),
    ("burley", "normalized diffusion", "burley", "published:diffuse", "diffuse", GREEN, "v", "--"),
    ("searchlight", "hazard, searchlight", "hazard", "regenerated", "searchlight", PURPLE, "D", ":"),
    ("liang refitted", "Liang, refitted", "liang", "regenerated", "searchlight", ORANGE, "P", "-"),
    ("liang corrected", "Liang, corrected", "liang", "corrected", "searchlight", ORANGE, "X", "--"),
    ("liang", "Liang, printed", "liang", "published", "searchlight", VERMILION, "X", ":"),
)
SEPARABLE = Contender("separable", SeparableFilter(), Sampling(), GREY, "*", "-.")
VARIED = ("hazard", "burley")
VARIANTS = (
    ("uniform", "longest"),
    ("importance", "longest"),
    ("importance blue", "longest"),
    ("importance", "mixture"),
    ("importance blue", "mixture"),
)


def contenders() -> dict[str, Contender]:
    """Return all laws by key, and the separable filter."""
    found = {
        key: Contender(label, profilefit.load(name, constants, Setting(light)), Sampling(), colour, marker, dashes)
        for key, label, name, constants, light, colour, marker, dashes in WANTED
    }
    return {**found, "separable": SEPARABLE}


def variants() -> dict[str, Contender]:
    """Return two laws with every way to draw radii."""
    laws = contenders()
    return {
        f"{key}, {kind}, {channels}": replace(laws[key], sampling=Sampling(kind=kind, channels=channels))
        for key in VARIED
        for kind, channels in VARIANTS
    }
