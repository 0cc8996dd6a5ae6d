"""What is asked of a V4L2 camera, and what it then does: everything is read back, for nothing is refused."""

import contextlib
from collections.abc import Mapping
from typing import Final

import cv2

from drivers.camera import CameraSpec
from drivers.errors import OptionsError
from drivers.video.options import V4l2Options
from drivers.video.source import Capture
from drivers.video.v4l2_node import Control, Node

_EXPOSURE_UNIT: Final = 1e-4
"""Seconds of V4L2's exposure time."""
_EXPOSURE: Final = 0x009A0902
_AUTO_EXPOSURE: Final = 0x009A0901
AUTOMATIC: Final[Mapping[int, tuple[str, int]]] = {
    _AUTO_EXPOSURE: ("sets its exposure by itself, so that pictures are blurred and bright as it likes", 1),
    0x009A0903: ("lengthens its exposures in the dark", 0),
    0x00980912: ("sets its gain by itself, so that pictures are as noisy as it likes", 0),
    0x009A090C: ("focuses by itself, which moves the lens that is being calibrated", 0),
    0x0098090C: ("sets its white balance by itself, so that greys change from view to view", 0),
    0x009A0916: ("stabilises its pictures, which moves them against the lens", 0),
}
"""The camera's own doings, by the id of their switch: what is wrong with each, and the value that ends it."""


def set_format(capture: Capture, spec: CameraSpec, options: V4l2Options) -> list[str]:
    """Ask for format, size, rate and buffers; return in sentences where the camera does otherwise.

    Raises OptionsError where its pictures have another size: a calibration holds for one.
    """
    wanted = options.pixel_format
    if wanted is not None:
        capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*wanted))
    # A width does nothing until a height follows it.
    capture.set(cv2.CAP_PROP_FRAME_WIDTH, spec.width)
    capture.set(cv2.CAP_PROP_FRAME_HEIGHT, spec.height)
    for prop, value in ((cv2.CAP_PROP_FPS, options.frame_rate), (cv2.CAP_PROP_BUFFERSIZE, options.buffers)):
        if value is not None:
            capture.set(prop, value)
    width, height = (int(capture.get(prop)) for prop in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT))
    if (width, height) != (spec.width, spec.height):
        raise OptionsError(
            f"camera '{spec.name}' gives pictures of {width} x {height} and was asked for "
            f"{spec.width} x {spec.height}: choose a size that 'v4l2-ctl --list-formats-ext' shows"
        )
    return _format_warnings(capture, spec.name, options)


def _format_warnings(capture: Capture, name: str, options: V4l2Options) -> list[str]:
    warnings = []
    given = (
        (int(capture.get(cv2.CAP_PROP_FOURCC)) & 0xFFFFFFFF).to_bytes(4, "little").decode("ascii", "replace")
    )
    if options.pixel_format not in (None, given):
        warnings.append(
            f"camera '{name}' gives pictures as {given} and was asked for {options.pixel_format}: "
            "choose a format that 'v4l2-ctl --list-formats' shows"
        )
    rate = capture.get(cv2.CAP_PROP_FPS)
    if options.frame_rate is not None and abs(rate - options.frame_rate) > 0.01 * options.frame_rate:
        warnings.append(
            f"camera '{name}' gives {rate:g} frames a second and was asked for {options.frame_rate:g}: "
            "choose a rate that 'v4l2-ctl --list-formats-ext' shows for this size"
        )
    buffers = int(capture.get(cv2.CAP_PROP_BUFFERSIZE))
    if options.buffers not in (None, buffers):
        warnings.append(f"camera '{name}' keeps {buffers} frames waiting and was asked for {options.buffers}")
    return warnings


def set_controls(node: Node, name: str, options: V4l2Options) -> list[str]:
    """Switch off what the camera does by itself, then set the controls; return in sentences what is not obeyed.

    Raises OptionsError for a control that it does not have, or a value outside of its range.
    """
    wanted = {_control(node, name, key): value for key, value in options.controls.items()}
    by_id = {control.id: control for control in node.controls.values()}
    if options.exposure is not None and _EXPOSURE in by_id:
        wanted.setdefault(by_id[_EXPOSURE], round(options.exposure / _EXPOSURE_UNIT))
    for control, value in wanted.items():
        _require_in_range(control, value, name)
    warnings = _switch_off(node, name, by_id, {control.id for control in wanted})
    # A camera's own doing keeps what it does from being set.
    for control, value in sorted(wanted.items(), key=lambda item: item[0].id not in AUTOMATIC):
        given = _try(node, control, value)
        if given != value:
            warnings.append(
                f"camera '{name}' has {control.name} at {given} and was asked for {value}: "
                "'v4l2-ctl --list-ctrls' shows what keeps it from that"
            )
        elif control.id in AUTOMATIC and value != AUTOMATIC[control.id][1]:
            warnings.append(_doing(name, control, "as the profile asks"))
    if _AUTO_EXPOSURE not in by_id and _EXPOSURE not in by_id:
        warnings.append(
            f"camera '{name}' does not tell its exposure, nor let it be set: see that its pictures do not "
            "change in brightness while it moves"
        )
    return warnings


def exposure_of(node: Node) -> float | None:
    """Return how long the camera exposes (s), None where it does not tell."""
    for control in node.controls.values():
        if control.id == _EXPOSURE:
            try:
                return node.get(control) * _EXPOSURE_UNIT or None
            except OSError:
                return None
    return None


def _control(node: Node, name: str, key: str) -> Control:
    if key not in node.controls:
        raise OptionsError(
            f"camera '{name}' has no control '{key}': it has {', '.join(node.controls) or 'none at all'}"
        )
    return node.controls[key]


def _require_in_range(control: Control, value: int, name: str) -> None:
    # Drivers clamp without a word: a mistake in the profile would never be noticed.
    if not control.minimum <= value <= control.maximum:
        raise OptionsError(
            f"camera '{name}' cannot have {control.name} at {value}: "
            f"its range is {control.minimum} to {control.maximum}"
        )


def _switch_off(node: Node, name: str, by_id: Mapping[int, Control], asked: set[int]) -> list[str]:
    warnings = []
    for key, (_, off) in AUTOMATIC.items():
        if key in by_id and key not in asked and _try(node, by_id[key], off) != off:
            warnings.append(_doing(name, by_id[key], "and cannot be kept from it"))
    return warnings


def _doing(name: str, control: Control, why: str) -> str:
    return f"camera '{name}' {AUTOMATIC[control.id][0]}, {why} ({control.name})"


def _try(node: Node, control: Control, value: int) -> int | str:
    """Set a control and return what it then is, or the system's words for why that is not known."""
    with contextlib.suppress(OSError):  # what counts is where it stands then
        node.set(control, value)
    try:
        return node.get(control)
    except OSError as error:
        return f"'{error.strerror}'"
