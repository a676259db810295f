"""Entry point of `python3 -m tools.foc33`."""

import signal
import sys

from .cli import main

signal.signal(signal.SIGTERM, signal.default_int_handler) # so that an ended run cleans up like an interrupted one
sys.exit(main())
