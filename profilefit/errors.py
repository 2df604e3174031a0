"""What can go wrong in fitting, by name. Every message says what was wrong, what was got and what is accepted."""

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
    """A recipe that is missing, malformed or requires the impossible."""


class RecordError(InputError):
    """A record that is missing, malformed or belongs to something else."""


class DamagedRecord(Notice):
    """A record that cannot be read and is not asked for is passed over."""


class OtherRecords(Notice):
    """The records in use are not those that came with this installation."""


class ShippedMap(Notice):
    """A folder of records lacks the map between alpha and A of a setting: the shipped one serves."""


class ShaderError(Exception):
    """A shader that does not compile, an OpenGL error, or no OpenGL at all."""
