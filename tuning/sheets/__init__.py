"""The sheets of tuning_params.xlsx."""
