"""Curves over a parameter: Fourier series, polynomials, splines; positions and orientations."""
