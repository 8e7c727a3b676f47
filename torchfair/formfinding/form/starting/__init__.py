"""Start surfaces between boundary curves: a coarse triangulation of the rim, and even triangles on it."""
