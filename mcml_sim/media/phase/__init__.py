"""Phase functions, a file each: how far scattering turns the light; imported on first use."""

from importlib import import_module

TYPE_CHECKING = False  # importing typing for it would take longer than all the rest
if TYPE_CHECKING:
    from mcml_sim.media.phase.fournier_forand import FournierForand
    from mcml_sim.media.phase.kinds import as_table, from_table, settle
    from mcml_sim.media.phase.mixture import Mixture
    from mcml_sim.media.phase.phase import HenyeyGreenstein, Isotropic, Phase
    from mcml_sim.media.phase.tabulated import Tabulated

HOMES = {
    "FournierForand": "fournier_forand",
    "HenyeyGreenstein": "phase",
    "Isotropic": "phase",
    "Mixture": "mixture",
    "Phase": "phase",
    "Tabulated": "tabulated",
    **dict.fromkeys(("as_table", "from_table", "settle"), "kinds"),
}

__all__ = [
    "FournierForand",
    "HenyeyGreenstein",
    "Isotropic",
    "Mixture",
    "Phase",
    "Tabulated",
    "as_table",
    "from_table",
    "settle",
]


def __getattr__(name: str) -> object:
    """Import a phase function on first use: JAX takes half a second, which a layer or a setting need not wait for."""
    if name not in HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{HOMES[name]}"), name)


def __dir__() -> list[str]:
    """Return the names that an interactive shell completes, unused ones included."""
    return [*globals(), *__all__]
