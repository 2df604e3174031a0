"""A stage, and a shader with an error in it, for what a test must not take for right."""

import pytest

from profilefit.scenes.stage import scattering
from profilefit.scenes.stage.stage import Stage


@pytest.fixture
def stage(context):
    """128 x 128 pixels."""
    with Stage(context, (128, 128), shadow_side=16) as stage:
        yield stage


@pytest.fixture
def alter(monkeypatch):
    """alter(old, new) changes a line of scatter.frag, for stages that are made afterwards; old is what stands there."""

    def change(old, new):
        before = scattering.stage_text
        assert before("scatter.frag").count(old) == 1
        monkeypatch.setattr(scattering, "stage_text", lambda name: before(name).replace(old, new))

    return change
