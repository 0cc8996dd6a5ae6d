"""The mathematics of an active camera's calibration, and its two file formats."""
