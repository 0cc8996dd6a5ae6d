"""Taking away: a stored calibration as the files that others read.

subject          the calibration, and what is known of how it came about
urdf             links and joints;  yaml_lens  a camera's lens, for ROS and OpenCV
session_archive  the views that it was solved from
making_reports   a report for the lab book, by a process of its own: report/
catalogue        all of them, by name

Nothing here needs a rig, a database or a daemon: the command line exports from files alone.
"""

from daemon.export.catalogue import EXPORTS, Content, Export, Offer, export_named, make, offer
from daemon.export.subject import Subject, axes_of

__all__ = [
    "EXPORTS",
    "Content",
    "Export",
    "Offer",
    "Subject",
    "axes_of",
    "export_named",
    "make",
    "offer",
]
