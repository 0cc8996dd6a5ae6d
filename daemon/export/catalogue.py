"""What can be taken away of a calibration, by the names of the files."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

from calib.errors import CalibError
from daemon.errors import ExportUnavailableError, UnknownExportError
from daemon.export.making_reports import made_apart
from daemon.export.session_archive import archive_of
from daemon.export.subject import Subject
from daemon.export.urdf import urdf, urdf_notes
from daemon.export.yaml_lens import camera_info, lens_notes, opencv_lens
from daemon.session_files import session_files

Content = bytes | Iterator[bytes]
"""A file, or its pieces one after another."""


@dataclass(frozen=True)
class Export:
    """A file that a calibration can be taken away as, made of a subject and a camera's name, None for the first."""

    name: str
    media_type: str
    purpose: str
    make: Callable[[Subject, str | None], Content]
    notes: Callable[[Subject, str | None], list[str]] = lambda _, __: []
    """Sentences on what the file cannot say of the calibration."""
    looks: bool = False
    """Whether it is made sooner where the subject knows what every point is off by."""
    size: Callable[[Subject, str | None], int | None] | None = None
    """How large it is, about, None where that takes making it; raises as `make` does. Else it is made."""


@dataclass(frozen=True)
class Offer:
    """An export as it can be had of one calibration; `problem` says why it cannot."""

    export: Export
    size: int | None
    notes: list[str]
    problem: str | None


def _session_size(subject: Subject, _: str | None) -> int:
    """Return the size of the session's files: packing makes hardly less of pictures."""
    return sum(path.stat().st_size for path in session_files(subject.session_folder()))


def _report_size(_: Subject, __: str | None) -> None:
    """Return nothing: a report is always to be had, and takes seconds to make."""


EXPORTS: Final = (
    Export(
        "report.pdf",
        "application/pdf",
        "a report for the lab book",
        lambda subject, _: made_apart("pdf", subject),
        looks=True,
        size=_report_size,
    ),
    Export(
        "report.html",
        "text/html",
        "the same for a browser, in one file",
        lambda subject, _: made_apart("html", subject),
        looks=True,
        size=_report_size,
    ),
    Export(
        "calibration.json",
        "application/json",
        "the calibration itself, for `activecam pose`, `verify` and `export`",
        lambda subject, _: subject.document,
    ),
    Export(
        "session.zip",
        "application/zip",
        "the views that it was solved from, for `activecam solve` after unpacking",
        lambda subject, _: archive_of(subject.session_folder()),
        size=_session_size,
    ),
    Export(
        "rig.urdf",
        "application/xml",
        "joints, links and cameras, for ROS, MoveIt and simulators",
        lambda subject, _: urdf(subject.calibration, subject.rig, subject.axes),
        lambda subject, _: urdf_notes(subject.calibration),
    ),
    Export(
        "camera_info.yaml",
        "application/yaml",
        "a camera's lens, for ROS's camera drivers and image_proc",
        lambda subject, camera: camera_info(subject.calibration, camera).encode(),
        lambda subject, camera: lens_notes(subject.calibration, camera),
    ),
    Export(
        "opencv.yaml",
        "application/yaml",
        "a camera's lens, for OpenCV's cv::FileStorage",
        lambda subject, camera: opencv_lens(subject.calibration, camera).encode(),
        lambda subject, camera: lens_notes(subject.calibration, camera),
    ),
)


def export_named(name: str) -> Export:
    """Return an export; raises UnknownExportError."""
    for export in EXPORTS:
        if export.name == name:
            return export
    raise UnknownExportError(
        f"there is no export '{name}'; there are {', '.join(export.name for export in EXPORTS)}"
    )


def make(export: Export, subject: Subject, camera: str | None = None) -> Content:
    """Return the file; raises ExportUnavailableError with a sentence on why there is none."""
    try:
        return export.make(subject, camera)
    except CalibError as error:
        raise ExportUnavailableError(str(error)) from error


def offer(export: Export, subject: Subject, camera: str | None = None) -> Offer:
    """Return whether an export can be had, what it lacks then, and how large it is."""
    try:
        if export.size is not None:
            size = export.size(subject, camera)
        else:
            content = make(export, subject, camera)
            size = len(content) if isinstance(content, bytes) else None
        return Offer(export, size, export.notes(subject, camera), None)
    except ExportUnavailableError as error:
        return Offer(export, None, [], str(error))
