"""What can go wrong in fitting, by name. Every message says what was wrong, what was got and what is accepted."""

from mcml_sim.errors import InputError, OutputError, SettingError, StoreError

__all__ = ["InputError", "OutputError", "RecipeError", "RecordError", "SettingError", "ShaderError", "StoreError"]


class RecipeError(InputError):
    """A recipe that is missing, malformed or asks for the impossible."""


class RecordError(InputError):
    """A record that is missing, malformed or belongs to something else."""


class ShaderError(Exception):
    """A shader that does not compile, an OpenGL error, or no OpenGL at all."""
