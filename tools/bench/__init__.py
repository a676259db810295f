"""foc33's front end: runs the firmware on the virtual board by scenario and reports how good it was."""
