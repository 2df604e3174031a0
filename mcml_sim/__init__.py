"""What light does in a half space: photons traced in JAX, and exact solutions to hold them against."""

from mcml_sim import exact
from mcml_sim.errors import InputError, SettingError, StoreError
from mcml_sim.grid import Grid
from mcml_sim.orders import Orders, simulate_orders
from mcml_sim.setting import Setting
from mcml_sim.tally import Estimate
from mcml_sim.version import __version__

__all__ = [
    "Estimate",
    "Grid",
    "InputError",
    "Orders",
    "Setting",
    "SettingError",
    "StoreError",
    "__version__",
    "exact",
    "simulate_orders",
]
