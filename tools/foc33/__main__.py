"""Entry point of `python3 -m tools.foc33`."""

import signal
import sys

from . import workers
from .cli import main

signal.signal(signal.SIGINT, workers.end)
signal.signal(signal.SIGTERM, workers.end)
sys.exit(main())
