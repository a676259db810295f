"""Tools around the firmware; makes `python3 -m tools.foc33` work from the project's root."""
