"""A stage, and a shader with an error in it, for what a test must not take for right."""

import pytest

from profilefit.scenes.stage import gather
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
        before = gather.text_beside
        assert before(gather.__name__, "glsl/scatter.frag").count(old) == 1
        monkeypatch.setattr(gather, "text_beside", lambda *place: before(*place).replace(old, new))

    return change
