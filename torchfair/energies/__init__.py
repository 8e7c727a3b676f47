"""Energies of meshes: one module per file, ``forward(vertices) -> (*batch,)``, each with a functional form."""

from .angle_variation import AngleVariation as AngleVariation
from .angle_variation import angle_variation as angle_variation
from .angle_variation import angle_variation_per_edge as angle_variation_per_edge
from .base import EdgeEnergy as EdgeEnergy
from .base import MeshModule as MeshModule
from .boundary_extrapolation import BoundaryExtrapolation as BoundaryExtrapolation
from .boundary_extrapolation import boundary_extrapolation as boundary_extrapolation
from .normal_variation import NormalVariation as NormalVariation
from .normal_variation import normal_variation as normal_variation
from .normal_variation import normal_variation_per_edge as normal_variation_per_edge
from .normal_variation_derivative import normal_variation_derivative as normal_variation_derivative
from .normal_variation_tangential_gradient import (
    normal_variation_tangential_gradient as normal_variation_tangential_gradient,
)
from .polyline_fairness import PolylineFairness as PolylineFairness
from .polyline_fairness import polyline_fairness as polyline_fairness
from .polyline_fairness import polyline_fairness_per_triple as polyline_fairness_per_triple
from .star_energy import StarEnergy as StarEnergy
from .total_absolute_curvature import TotalAbsoluteCurvature as TotalAbsoluteCurvature
from .total_absolute_curvature import total_absolute_curvature as total_absolute_curvature
from .total_absolute_curvature import total_absolute_curvature_per_vertex as total_absolute_curvature_per_vertex
from .total_frobenius_curvature import TotalFrobeniusCurvature as TotalFrobeniusCurvature
from .total_frobenius_curvature import total_frobenius_curvature as total_frobenius_curvature
from .total_frobenius_curvature import total_frobenius_curvature_per_vertex as total_frobenius_curvature_per_vertex
from .total_mean_curvature import TotalMeanCurvature as TotalMeanCurvature
from .total_mean_curvature import total_mean_curvature as total_mean_curvature
from .total_mean_curvature import total_mean_curvature_per_edge as total_mean_curvature_per_edge
from .umbrella_fairness import UmbrellaFairness as UmbrellaFairness
from .umbrella_fairness import umbrella_fairness as umbrella_fairness
from .umbrella_fairness import umbrella_fairness_per_vertex as umbrella_fairness_per_vertex
from .willmore_energy import WillmoreEnergy as WillmoreEnergy
from .willmore_energy import willmore_energy as willmore_energy
from .willmore_energy import willmore_energy_per_vertex as willmore_energy_per_vertex
