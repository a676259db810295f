"""Entry point of `python3 -m tools.bench`."""

import signal
import sys

from tools.common import workers
from .cli import main

signal.signal(signal.SIGINT, workers.end)
signal.signal(signal.SIGTERM, workers.end)
sys.exit(main())
