"""Entry point of `python3 -m tuning`."""

import signal
import sys

from tools.common import workers

from .cli import main

if __name__ == "__main__":
    signal.signal(signal.SIGINT, workers.end)
    signal.signal(signal.SIGTERM, workers.end)
    sys.exit(main())
