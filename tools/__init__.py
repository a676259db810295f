"""Tools around the firmware; makes `python3 -m tools.bench` work from the project's root."""
