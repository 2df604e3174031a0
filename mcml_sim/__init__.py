"""Light in layered media: photons traced in JAX, and exact solutions to hold them against."""

from mcml_sim.cli.lazy import attributes
from mcml_sim.errors import ClusterError, ForkError, InputError, OutputError, SettingError, StoreError

TYPE_CHECKING = False  # importing typing for it would take longer than all the rest, while Ctrl-C is a traceback
if TYPE_CHECKING:
    from mcml_sim import exact
    from mcml_sim.files.version import __version__
    from mcml_sim.media import phase
    from mcml_sim.media.grid import Grid
    from mcml_sim.media.medium import Layer, Medium, half_space
    from mcml_sim.media.setting import Setting
    from mcml_sim.results.estimate import Estimate
    from mcml_sim.results.mci import read_mci
    from mcml_sim.results.mco import read_mco, write_mco
    from mcml_sim.results.orders import Orders
    from mcml_sim.results.tally import Precision, Tally, read_results, write_results
    from mcml_sim.runs.simulation import simulate, simulate_orders, trace_share
    from mcml_sim.runs.store import DamagedBatch
else:
    __getattr__, __dir__ = attributes(
        __name__,
        {
            "exact": "",
            "phase": "media.",
            "Grid": "media.grid",
            "read_mci": "results.mci",
            **dict.fromkeys(("read_mco", "write_mco"), "results.mco"),
            **dict.fromkeys(("Layer", "Medium", "half_space"), "media.medium"),
            "Orders": "results.orders",
            **dict.fromkeys(("Precision", "Tally", "read_results", "write_results"), "results.tally"),
            "Setting": "media.setting",
            **dict.fromkeys(("simulate", "simulate_orders", "trace_share"), "runs.simulation"),
            "DamagedBatch": "runs.store",
            "Estimate": "results.estimate",
            "__version__": "files.version",
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
    "phase",
    "read_mci",
    "read_mco",
    "read_results",
    "simulate",
    "simulate_orders",
    "trace_share",
    "write_mco",
    "write_results",
]
