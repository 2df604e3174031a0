"""A folder that tests of mutated files and of commands on them share."""

import pytest

from tests.unit.hostile import mutations


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """A folder to work in, where what a payload would make is seen."""
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    assert not list(tmp_path.rglob(f"*{mutations.CANARY}*"))
