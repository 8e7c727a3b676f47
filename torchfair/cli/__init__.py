"""The command ``torchfair``; every subcommand is one file with ``add_parser`` and ``run``."""

from .command import main as main
