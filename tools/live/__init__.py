"""A firmware that runs: make live, a page in the browser, and make live-board, a serial line with its client."""
