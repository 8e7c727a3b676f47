"""Reflections of meshes: their variation in closed form, pictures, and the score of a picture."""

from .camera import Camera as Camera
from .edge_visibility import edge_visibility as edge_visibility
from .environments import Checker as Checker
from .environments import Environment as Environment
from .environments import EquirectangularImage as EquirectangularImage
from .environments import Stripes as Stripes
from .orthographic_camera import OrthographicCamera as OrthographicCamera
from .perspective_camera import PerspectiveCamera as PerspectiveCamera
from .render import Reflection as Reflection
from .render import render_reflection as render_reflection
from .variation import ReflectionVariation as ReflectionVariation
from .variation import reflection_variation as reflection_variation
from .variation import reflection_variation_per_edge as reflection_variation_per_edge
from .variation_from_eyes import reflection_variation_from_eyes as reflection_variation_from_eyes
from .variation_from_eyes import reflection_variation_from_eyes_per_edge as reflection_variation_from_eyes_per_edge
from .variation_from_eyes import solid_angles as solid_angles
from .view_directions import axis_directions as axis_directions
from .view_directions import cone_directions as cone_directions
from .view_directions import ring_directions as ring_directions
