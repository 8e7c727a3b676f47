"""How large things may be."""

MOST_VERTICES = 200_000
"""Of a mesh that is designed with."""
MOST_UPLOAD = 128 << 20
"""Bytes of a file that is dropped."""
MOST_NUMBERED = 1_000_000
"""Numbers of vertices up to which a command is well formed, whatever the mesh is."""
