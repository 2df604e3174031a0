"""Calibrated closed forms on a stage, each beside its truth; what is here is imported on first use.

with profilefit.scenes.Stage(context, (512, 512)) as stage:
    stage.draw(profilefit.scenes.head_scene())
"""

from mcml_sim.cli.lazy import attributes

TYPE_CHECKING = False  # importing typing for it would take longer than all the rest
if TYPE_CHECKING:
    from profilefit.scenes import fur, heart, layers, sea
    from profilefit.scenes.skin.chart import covering
    from profilefit.scenes.skin.law import Separable
    from profilefit.scenes.skin.material import translucent
    from profilefit.scenes.skin.passes import SeparableFilter
    from profilefit.scenes.skin.scene import head_scene
    from profilefit.scenes.stage.exact_law import ExactLaw
    from profilefit.scenes.stage.judge import srgb_codes, to_srgb
    from profilefit.scenes.stage.pattern import Sampling
    from profilefit.scenes.stage.reference.step_edge import step_response
    from profilefit.scenes.stage.reference.surface import gathered, seen
    from profilefit.scenes.stage.stage import Stage
    from profilefit.scenes.stage.technique import Lambert
    from profilefit.scenes.stage.world import Camera
else:
    __getattr__, __dir__ = attributes(
        __name__,
        {
            **dict.fromkeys(("fur", "heart", "layers", "sea"), ""),
            "Separable": "skin.law",
            "translucent": "skin.material",
            "SeparableFilter": "skin.passes",
            "head_scene": "skin.scene",
            "ExactLaw": "stage.exact_law",
            "Sampling": "stage.pattern",
            **dict.fromkeys(("srgb_codes", "to_srgb"), "stage.judge"),
            "Stage": "stage.stage",
            "covering": "skin.chart",
            "step_response": "stage.reference.step_edge",
            "seen": "stage.reference.surface",
            "gathered": "stage.reference.surface",
            "Lambert": "stage.technique",
            "Camera": "stage.world",
        },
    )

# By its name in a file's key `scene`: the module that reads such a file and draws it, and an example of one.
SCENES = {
    "skin": ("profilefit.scenes.skin.scene", "skin-head.toml"),
    "layers": ("profilefit.scenes.layers.scene", "layers-head.toml"),
    "heart": ("profilefit.scenes.heart.scene", "heart.toml"),
    "sea": ("profilefit.scenes.sea.scene", "sea.toml"),
    "fur": ("profilefit.scenes.fur.scene", "fur.toml"),
}

# What scenes export, by its name or by how that of a file ends: what it is, and the module whose `source` writes it.
SOURCES = {
    "sea-segment": ("of light in water", "profilefit.scenes.sea.source"),
    ".toml": ("of light in water", "profilefit.scenes.sea.source"),
    "fur": ("of fur", "profilefit.scenes.fur.law"),
}

__all__ = [
    "SCENES",
    "SOURCES",
    "Camera",
    "ExactLaw",
    "Lambert",
    "Sampling",
    "Separable",
    "SeparableFilter",
    "Stage",
    "covering",
    "fur",
    "gathered",
    "head_scene",
    "heart",
    "layers",
    "sea",
    "seen",
    "srgb_codes",
    "step_response",
    "to_srgb",
    "translucent",
]
