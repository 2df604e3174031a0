"""How much light each setting gets, and where it is kept."""

import numpy as np
import pytest

from mcml_sim import Setting
from profilefit.recipes.run import PHOTONS, REFRACTED_PHOTONS, RecipeRun

SETTINGS = {
    Setting(): "",
    Setting("diffuse"): "diffuse",
    Setting(n=1.4): "n1.4",
    Setting("diffuse", n=1.4): "diffuse-n1.4",
}


@pytest.fixture
def run(tmp_path):
    said: list[str] = []
    return RecipeRun("quick", 3, tmp_path / "out", tmp_path / "photons", 2000, said.append, False)


@pytest.mark.slow
def test_every_setting_has_its_own_store_and_resumes(run):
    for setting, folder in SETTINGS.items():
        light = run.light(setting)
        assert (light.setting, light.photons, light.seed) == (setting, 2000, 3)
        batches = sorted((run.store / folder).glob("batch-*"))
        assert len(batches) == 1
        before = batches[0].stat().st_mtime_ns
        assert np.array_equal(run.part().light(setting).counts.exits, light.counts.exits)
        assert batches[0].stat().st_mtime_ns == before
    assert len(list(run.store.rglob("batch-*"))) == len(SETTINGS)


def test_presets_give_surfaces_that_refract_fewer_photons(tmp_path):
    for preset in ("quick", "full"):
        traced = [RecipeRun(preset, 0, tmp_path, None, None, print).number(setting) for setting in SETTINGS]
        assert traced == [PHOTONS[preset]] * 2 + [REFRACTED_PHOTONS[preset]] * 2
        assert REFRACTED_PHOTONS[preset] < PHOTONS[preset]
    assert RecipeRun("full", 0, tmp_path, None, 7, print).number(Setting(n=1.4)) == 7
