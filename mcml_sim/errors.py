"""Errors by name. Every message says what was wrong, what was got and what is accepted."""

# Remedies that errors name; a command line has other words for them.
ELSEWHERE = "use another folder"
NAMED = "a folder to write into"
RESUMES = "the same run with its store resumes"


class Notice(UserWarning):
    """Warning to the user beside the answer; a command line prints it on stderr."""


class InputError(ValueError):
    """Argument that no physics or file format allows."""


class SettingError(InputError):
    """Light or surface that this code does not solve, or two settings that do not mix."""


class StoreError(RuntimeError):
    """Folder of photon batches that is damaged, foreign, or cannot be written."""


class ClusterError(RuntimeError):
    """Dask cluster that does not answer, or whose workers would not give the bits of this machine."""


class OutputError(RuntimeError):
    """File of results that cannot be written."""


class ForkError(RuntimeError):
    """Work in a process that was forked from one where JAX had worked: it would wait for ever."""
