"""Finished meshes as differentiable functions of what jobs are given."""
