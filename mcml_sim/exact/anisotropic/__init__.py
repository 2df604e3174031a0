"""Half space whose scattering has a direction: high orders solved, low ones from photons, as tables."""
