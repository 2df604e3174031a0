"""Version of the distribution that holds this package."""

from importlib.metadata import version

__version__ = version("profilefit")
