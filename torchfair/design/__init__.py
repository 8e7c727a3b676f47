"""Interactive design in the browser: ``torchfair design``, and :func:`view` in notebooks.

Handles are pulled in a page and the mesh answers, mirrors and numbers with it. Everything that computes runs in a
process of its own; :mod:`torchfair.design.session` says what may happen when.
"""

from .notebook import view as view
