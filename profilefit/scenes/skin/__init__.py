"""Head after Liang et al., drawn by samples of a law or by a separable filter."""
