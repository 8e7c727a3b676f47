"""Orthonormal bases of tangent planes."""

from __future__ import annotations

import torch
from torch import Tensor

CUT = -0.3
"""Height of the normal at which the basis changes its formula. Level and vertical faces, the common ones, are away
from it, and so is every height field with upward normals."""


def tangent_bases(normals: Tensor) -> Tensor:
    """An orthonormal basis ``b1, b2`` of the plane orthogonal to every unit normal, with ``b1 x b2 = n``.

    The basis is that of the x, y plane turned with the normal: about the axis of the smallest rotation that
    takes +z to the normal, or -z to it where ``n_z < -0.3`` (Duff et al., *Building an Orthonormal Basis,
    Revisited*, 2017, with another cut). No basis depends continuously on the normal over the whole sphere;
    this one jumps at ``n_z = -0.3``, and anything that should not depend on the basis does not see it.

    Args:
        normals: (..., 3), length 1 or 0.

    Returns:
        (..., 2, 3): unit vectors, or two zero vectors, with zero derivatives, where the normal is zero. It
        does not turn with the mesh: only what is built from it does.

    Example:
        >>> import torch
        >>> from torchfair.geometry import tangent_bases
        >>> tangent_bases(torch.tensor([[0.0, 0.0, 1.0]])).shape
        torch.Size([1, 2, 3])
    """
    x, y, z = normals.unbind(-1)
    sign = torch.where(z < CUT, -1.0, 1.0).to(normals.dtype)
    slant = -1 / (sign + z)  # between -1.43 and 1.43
    skew = x * y * slant
    first = torch.stack([1 + sign * x * x * slant, sign * skew, -sign * x], dim=-1)
    second = torch.stack([skew, sign + y * y * slant, -y], dim=-1)
    known = (normals != 0).any(-1)[..., None, None]
    return torch.where(known, torch.stack([first, second], dim=-2), 0.0)
