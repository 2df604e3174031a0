"""What light does in layered media: photons traced in JAX, and exact solutions to hold them against."""

from mcml_sim.errors import ClusterError, ForkError, InputError, OutputError, SettingError, StoreError
from mcml_sim.lazy import attributes

TYPE_CHECKING = False  # importing typing for it would take longer than all the rest, while Ctrl-C is a traceback
if TYPE_CHECKING:
    from mcml_sim import exact
    from mcml_sim.grid import Grid
    from mcml_sim.mcml_files import read_mci, read_mco, write_mco
    from mcml_sim.medium import Layer, Medium, half_space
    from mcml_sim.orders import Orders, simulate_orders, trace_share
    from mcml_sim.quantities import Precision, Tally
    from mcml_sim.results import read_results, write_results
    from mcml_sim.setting import Setting
    from mcml_sim.simulation import simulate
    from mcml_sim.store import DamagedBatch
    from mcml_sim.tally import Estimate
    from mcml_sim.version import __version__
else:
    __getattr__ = attributes(
        __name__,
        {
            "exact": "",
            "Grid": "grid",
            **dict.fromkeys(("read_mci", "read_mco", "write_mco"), "mcml_files"),
            **dict.fromkeys(("Layer", "Medium", "half_space"), "medium"),
            **dict.fromkeys(("Orders", "simulate_orders", "trace_share"), "orders"),
            **dict.fromkeys(("Precision", "Tally"), "quantities"),
            **dict.fromkeys(("read_results", "write_results"), "results"),
            "Setting": "setting",
            "simulate": "simulation",
            "DamagedBatch": "store",
            "Estimate": "tally",
            "__version__": "version",
        },
    )

__all__ = [
    "ClusterError",
    "DamagedBatch",
    "Estimate",
    "ForkError",
    "Grid",
    "InputError",
    "Layer",
    "Medium",
    "Orders",
    "OutputError",
    "Precision",
    "Setting",
    "SettingError",
    "StoreError",
    "Tally",
    "__version__",
    "exact",
    "half_space",
    "read_mci",
    "read_mco",
    "read_results",
    "simulate",
    "simulate_orders",
    "trace_share",
    "write_mco",
    "write_results",
]


def __dir__() -> list[str]:
    """What an interactive shell completes: names that nobody has asked for yet, too."""
    return [*globals(), *__all__]
