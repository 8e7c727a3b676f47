"""Names of linear solvers, for settings and for :mod:`torchfair.linear`, which makes them."""

SOLVERS = ("auto", "dense", "scipy", "rslab", "cg")
