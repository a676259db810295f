"""The tuner: from a motor file and a board file to a userparams.h with which the motor turns."""
