"""What the paper reports of its own rig, to be printed beside ours (its tables 1 to 4).

The rig: a camera with a 16 mm lens on a positioning table with one horizontal translation and one rotation
about a vertical axis, 42 printed disks, 11 positions along each axis.
"""

TRANSLATION_M = tuple(step / 10 for step in range(1, 11))
"""Table 1: distances travelled."""
TRANSLATION_ERROR_M = tuple(
    error * 1e-3 for error in (0.0081, 0.013, 0.018, 0.023, 0.028, 0.033, 0.039, 0.044, 0.049, 0.054)
)
TRANSLATION_PERCENT = (0.0081, 0.0066, 0.0061, 0.0059, 0.0057, 0.0056, 0.0055, 0.0055, 0.0054, 0.0054)

ROTATION_RAD = (0.052, 0.104, 0.157, 0.209, 0.262, 0.349, 0.523, 0.698, 0.872, 1.047)
"""Table 2: angles turned."""
ROTATION_ERROR_RAD = tuple(error * 1e-3 for error in (0.20, 0.31, 0.44, 0.58, 0.73, 0.97, 1.5, 1.9, 2.4, 2.9))
ROTATION_PERCENT = (0.373, 0.294, 0.282, 0.278, 0.277, 0.277, 0.277, 0.277, 0.278, 0.278)

PREDICTION_AFTER_TRANSLATION_PX = (0.660, 0.614, 0.523, 0.433, 0.388)
"""Table 3: mean distance between predicted and measured points, at five positions."""
PREDICTION_AFTER_ROTATION_PX = (0.513, 0.433, 0.523, 0.466, 0.406)
"""Table 4."""
