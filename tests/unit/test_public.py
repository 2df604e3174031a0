"""The names that other people's code calls, with the arguments that it gives them."""

import inspect

import numpy as np
import pytest

import mcml_sim
import profilefit

SIGNATURES = {
    "Setting": (mcml_sim, "illumination n g phase"),
    "Layer": (mcml_sim, "n mu_a mu_s g thickness phase"),
    "Medium": (mcml_sim, "layers n_above n_below"),
    "half_space": (mcml_sim, "alpha mfp n g"),
    "Grid.from_edges": (mcml_sim, "r z na"),
    "simulate": (mcml_sim, "medium grid photons seed store workers precision"),
    "simulate_orders": (mcml_sim, "grid photons seed setting store"),
    "Orders.reflectance": (mcml_sim, "self alpha"),
    "Orders.profile": (mcml_sim, "self alpha"),
    "Orders.profile_derivative": (mcml_sim, "self alpha"),
    "exact.reflectance": (mcml_sim, "alpha setting"),
    "exact.profile": (mcml_sim, "r alpha mfp setting"),
    "exact.cdf": (mcml_sim, "r alpha mfp setting"),
    "exact.quantile": (mcml_sim, "xi alpha mfp setting"),
    "exact.decay_rate": (mcml_sim, "alpha"),
    "exact.error_estimate": (mcml_sim, "r alpha mfp setting"),
    "exact.solve": (mcml_sim, "medium illumination"),
    "exact.Solution.transform": (mcml_sim, "self k"),
    "exact.Solution.profile": (mcml_sim, "self r"),
    "exact.Solution.cdf": (mcml_sim, "self r"),
    "phase.HenyeyGreenstein": (mcml_sim, "g"),
    "phase.Isotropic": (mcml_sim, ""),
    "phase.Mixture": (mcml_sim, "weights phases"),
    "phase.Tabulated": (mcml_sim, "angles values"),
    "phase.FournierForand": (mcml_sim, "n mu"),
    "phase.Phase.pdf": (mcml_sim, "self cosine"),
    "phase.Phase.sample": (mcml_sim, "self xi"),
    "phase.Phase.invert": (mcml_sim, "self cosine"),
    "phase.Phase.moment": (mcml_sim, "self l"),
    "read_mci": (mcml_sim, "path"),
    "read_mco": (mcml_sim, "path"),
    "write_mco": (mcml_sim, "tally path"),
    "names": (profilefit, ""),
    "load": (profilefit, "name constants setting"),
    "albedo_law": (profilefit, "name constants setting"),
    "fit": (profilefit, "profiles law"),
    "posterior": (profilefit, "fit"),
    "scenes.layers.single_scattering": (profilefit, "medium cos_in cos_out azimuth"),
    "scenes.layers.stack_law": (profilefit, "medium illumination"),
    "scenes.sea.haltrin": (profilefit, "g"),
    "scenes.sea.beam_share": (profilefit, "omega ct cw lobes"),
    "scenes.sea.segment_integral": (profilefit, "c s0 t0 m t1"),
    "scenes.sea.first_hit": (profilefit, "height origin direction lowest highest steps"),
    "scenes.sea.caustic_irradiance": (profilefit, "surface x depth tilt n"),
}


@pytest.mark.parametrize("name", SIGNATURES)
def test_arguments_have_their_names_and_places(name):
    found, expected = SIGNATURES[name]
    for one in name.split("."):
        found = getattr(found, one)
    given = list(inspect.signature(found).parameters)
    wanted = expected.split()
    assert set(wanted) <= set(given)
    assert [one for one in given if one in wanted] == wanted


@pytest.mark.parametrize("package", [mcml_sim, profilefit])
def test_every_promised_name_is_there(package):
    assert all(getattr(package, name) is not None for name in package.__all__)


@pytest.mark.parametrize("name", profilefit.names())
def test_a_law_answers_by_name(name):
    law = profilefit.load(name, "published" if name == "burley_diffuse_mfp" else "regenerated")
    assert isinstance(law.profile(0.5, 0.9), float)
    assert law.profile(np.array([0.1, 0.5]), 0.9, mfp=2.0).shape == (2,)
    assert 0.0 < law.cdf(0.5, 0.9, mfp=1.0) < 1.0


@pytest.mark.parametrize("name", ["hazard", "quantile", "burley", "liang"])
def test_a_sampler_answers_by_name(name):
    sampler = profilefit.load(name).sampler
    r = sampler.sample(0.5, 0.9, mfp=1.0)
    assert isinstance(r, float)
    assert sampler.pdf(r, 0.9, mfp=1.0) > 0.0


@pytest.mark.parametrize("name", ["rational", "liang", "chiang", "van_de_hulst"])
def test_a_map_answers_by_name(name):
    law = profilefit.albedo_law(name, "published" if name in ("chiang", "van_de_hulst") else "regenerated")
    assert law.alpha(law.reflectance(0.9)) == pytest.approx(0.9, abs=0.05)
