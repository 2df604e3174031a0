"""What light does in layered media: photons traced in JAX, and exact solutions to hold them against."""

from mcml_sim import exact
from mcml_sim.errors import InputError, SettingError, StoreError
from mcml_sim.grid import Grid
from mcml_sim.medium import Layer, Medium, half_space
from mcml_sim.orders import Orders, simulate_orders
from mcml_sim.setting import Setting
from mcml_sim.tally import Estimate
from mcml_sim.version import __version__

__all__ = [
    "Estimate",
    "Grid",
    "InputError",
    "Layer",
    "Medium",
    "Orders",
    "Setting",
    "SettingError",
    "StoreError",
    "__version__",
    "exact",
    "half_space",
    "simulate_orders",
]
