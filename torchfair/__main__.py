"""``python -m torchfair`` is the command ``torchfair``."""

import sys

from .cli import main

sys.exit(main())
