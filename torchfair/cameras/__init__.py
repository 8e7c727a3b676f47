"""Cameras: where the eye is, and how points in space become pixels. Pictures and reflections share them."""

from .camera import Camera as Camera
from .camera import Size as Size
from .orthographic_camera import OrthographicCamera as OrthographicCamera
from .perspective_camera import PerspectiveCamera as PerspectiveCamera
