"""A shader with an error in it, for what a test must not take for right."""

import pytest

from profilefit.shader.stage import scattering


@pytest.fixture
def alter(monkeypatch):
    """alter(old, new) changes a line of scatter.frag, for stages that are made afterwards; old is what stands there."""

    def change(old, new):
        before = scattering.stage_text
        assert before("scatter.frag").count(old) == 1
        monkeypatch.setattr(scattering, "stage_text", lambda name: before(name).replace(old, new))

    return change
