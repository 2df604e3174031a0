"""What every scene shares: G-buffer, shadow map, gather, exact edges and integrals, a head."""
