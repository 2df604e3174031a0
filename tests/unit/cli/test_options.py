"""What the library says, in words of the command line."""

import pytest

from profilefit.cli.options import in_options


@pytest.mark.parametrize(
    ("told", "said"),
    [
        ("out must be another folder, got out", "--out must be another folder, got out"),
        ("held alpha must be in (0, 1)", "--fix alpha must be in (0, 1)"),
        ("x.csv: no row is left between `r_min` and `r_max`", "x.csv: no row is left between --r-min and --r-max"),
        ("x.csv:1: column r: out must be", "x.csv:1: column r: out must be"),
        ("constants of a record are its own", "constants of a record are its own"),
        (
            "lang must be glsl; `profilefit report` lists `names`",
            "lang must be glsl; `profilefit report` lists `names`",
        ),
    ],
)
def test_arguments_are_named_by_their_options(told, said):
    assert in_options(told) == said


def test_content_is_gone_through_and_numbers_stay():
    told = {"data": {"notes": ("left out by `r_min`",), "rows": 3}, "result": "hold it with `held` alpha=..."}
    assert in_options(told) == {
        "data": {"notes": ["left out by --r-min"], "rows": 3},
        "result": "hold it with --fix alpha=...",
    }
