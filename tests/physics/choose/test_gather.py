"""The predicted samples: against the plain estimator on a plane, and a loop around a cylinder."""

import math
from dataclasses import replace

import numpy as np
import pytest

from profilefit.scenes.stage.step_edge import by_law, edge_estimate, shifted_points
from profilefit.studies.choose.predicted import LEAST_COSINE, OWN, drawn, estimates
from profilefit.studies.choose.response import beyond, response
from tests.physics.choose.conftest import DIFFUSE, MFP

ALPHA = (0.9, 0.8, 0.7)
SAMPLES = 16


@pytest.mark.slow
def test_plane_is_the_plain_estimator(hazard, case):
    """Root mean square error of the longest channel; 4 % is what 1024 estimates tell."""
    x = np.array([0.2, 0.9, 2.0])
    found = estimates(hazard, ALPHA, SAMPLES, case, 0, x)
    plain = edge_estimate(by_law(hazard, 0.9), shifted_points(SAMPLES, 1024, 7), x, 0.9, DIFFUSE)
    truth = response(beyond(0.9, DIFFUSE, hazard), x, 1.0, np.inf)
    noise = np.sqrt(np.mean((found - truth[:, None]) ** 2))
    expected = np.sqrt(np.mean(plain.rmse**2))
    assert abs(noise / expected - 1.0) < 0.12  # three deviates of both
    fewer = estimates(hazard, ALPHA, 8, case, 0, x)
    assert abs(np.sqrt(np.mean((fewer - truth[:, None]) ** 2)) / expected - 1.0) > 0.12


@pytest.mark.slow
def test_cylinder_is_the_obvious_loop(hazard, case):
    curved = replace(case, radius=3.0, window=(20.0, 2.0))
    x, channel = 0.625, 1
    found = estimates(hazard, ALPHA, SAMPLES, curved, channel, np.array([x]))[0, 5]
    radii, known, angle = (one[5] for one in drawn(hazard, ALPHA[0], SAMPLES))
    lit, total = OWN * SAMPLES, OWN * SAMPLES
    for r, p, phi in zip(radii, known, angle, strict=True):
        across, up = x + r * math.cos(phi), r * math.sin(phi)
        middle = (math.floor(across / 0.25) + 0.5) * 0.25
        if abs(middle) >= 3.0 or abs(up) >= 2.0:
            continue
        normal = (
            np.array([middle, math.sqrt(9.0 - middle**2)]) / 3.0
        )  # of the pixel's plane, and how high a ray meets it
        height = 3.0 * normal[1] - (across - middle) * normal[0] / normal[1]
        distance = math.hypot(r, height - math.sqrt(9.0 - x**2))
        profile = float(hazard.profile(distance, ALPHA[channel], MFP[channel])) * 2.0 * math.pi * r
        share = float(hazard.cdf(1e6, ALPHA[channel]))
        weight = profile / share / p / max(normal[1], LEAST_COSINE)
        weight /= float(hazard.albedo.reflectance(ALPHA[channel]))
        lit, total = lit + weight * (across > 0), total + weight
    assert abs(found - lit / total) < 1e-4


def test_short_paths_fade_to_lambert(hazard, case):
    """Below a twentieth of a pixel nothing is blurred; between that and a tenth a part is."""
    x = np.array([10.0])
    for pixel, is_blurred in ((30.0, False), (12.0, True)):
        found = estimates(hazard, ALPHA, 4, replace(case, pixel=pixel), 0, 0.05 * x)
        assert np.any(found < 1.0) == is_blurred
