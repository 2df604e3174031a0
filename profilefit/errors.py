"""Errors of fitting by name. Every message says what was wrong, what was got and what is accepted."""

from mcml_sim.errors import InputError, Notice, OutputError, SettingError, StoreError

__all__ = [
    "DamagedRecord",
    "InputError",
    "Notice",
    "OtherRecords",
    "OutputError",
    "RecipeError",
    "RecordError",
    "SettingError",
    "ShaderError",
    "ShippedMap",
    "StoreError",
]


class RecipeError(InputError):
    """Recipe that is missing, malformed or requires the impossible."""


class RecordError(InputError):
    """Record that is missing, malformed or belongs to something else."""


class DamagedRecord(Notice):
    """Notice that a record which nobody asked for cannot be read and is passed over."""


class OtherRecords(Notice):
    """Notice that the records in use are not those that came with this installation."""


class ShippedMap(Notice):
    """Notice that a folder of records lacks the map between alpha and A of a setting, and the shipped one is used."""


class ShaderError(Exception):
    """Shader that does not compile, an OpenGL error, or no OpenGL at all."""
