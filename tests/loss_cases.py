"""Losses of a topology that every kind of test of them goes through."""

from __future__ import annotations

from collections.abc import Callable

from torchfair import Topology, energies, reflection, stars

LOSSES: dict[str, Callable[[Topology], energies.MeshModule]] = {
    "E": energies.NormalVariation,
    "E'": energies.AngleVariation,
    "mean curvature": energies.TotalMeanCurvature,
    "C": energies.TotalAbsoluteCurvature,
    "C, extrapolated": lambda t: energies.TotalAbsoluteCurvature(t, boundary="extrapolated"),
    "C2, corrected": lambda t: energies.TotalFrobeniusCurvature(t, estimator="corrected"),
    "Willmore": energies.WillmoreEnergy,
    "umbrella": energies.UmbrellaFairness,
    "polylines": energies.PolylineFairness,
    "pyramids": stars.PyramidPenalty,
    "saddles": stars.SaddlePenalty,
    "reflection variation": reflection.ReflectionVariation,
}
