"""Entry point of `python3 -m tools.foc33`."""

import sys

from .cli import main

sys.exit(main())
