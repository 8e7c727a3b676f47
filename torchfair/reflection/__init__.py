"""Reflections of meshes: their variation in closed form, pictures, and the score of a picture."""

from .variation import ReflectionVariation as ReflectionVariation
from .variation import axis_directions as axis_directions
from .variation import reflection_variation as reflection_variation
from .variation import reflection_variation_per_edge as reflection_variation_per_edge
from .variation_from_eyes import reflection_variation_from_eyes as reflection_variation_from_eyes
from .variation_from_eyes import reflection_variation_from_eyes_per_edge as reflection_variation_from_eyes_per_edge
from .variation_from_eyes import solid_angles as solid_angles
