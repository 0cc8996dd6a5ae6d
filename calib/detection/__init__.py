"""Finding a printed target's points in a picture.

picture      what a camera gave, as grey values to search and to measure in
circle_grid  symmetric and asymmetric grids of disks;  disks  their centroids on the grey values
chessboard   inner corners of a chessboard
charuco      chessboard corners that markers number
aprilgrid    corners of tags
corners      corners on the grey values;  labelling  which of a grid's readings is the target's
"""

from calib.detection.detection import Detection
from calib.detection.detector import detect

__all__ = ["Detection", "detect"]
