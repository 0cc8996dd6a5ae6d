"""What can go wrong in the mathematics and its files, as one tree.

    CalibError
    ├── FormatError (ValueError)          a session or calibration file is not what its format asks for
    ├── ImageError (OSError)              a view's picture is missing or cannot be read
    ├── DetectionError                    a picture in which the target was not found, and why
    ├── ReadingsError (ValueError)        readings of the wrong number, or not numbers
    └── UnsolvableError                   the views do not determine what was asked: which, and what would
    help

Every message is one sentence that names the file, view, joint or field and says what to do.
"""


class CalibError(Exception):
    """A calibration could not be computed, read or applied."""


class FormatError(CalibError, ValueError):
    """A session or calibration file is not what its format asks for; names the field."""


class ImageError(CalibError, OSError):
    """A view's picture is missing or cannot be read as an image."""


class DetectionError(CalibError):
    """The target was not found in a picture."""


class ReadingsError(CalibError, ValueError):
    """Readings that are not one finite number for each joint of the calibration."""


class UnsolvableError(CalibError):
    """The views do not determine what was asked; the message says which part and what would help."""
