"""Status reports: `<Idle|MPos:1.000,2.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>`."""

import re
from dataclasses import dataclass
from typing import Final

MOVING: Final = frozenset({"Run", "Jog", "Home"})
_NUMBER = r"-?\d+\.\d+"
_NUMBERS = rf"{_NUMBER}(?:,{_NUMBER})*"
_REPORT = re.compile(r"<([A-Z][a-z]+)(?::(\d+))?((?:\|[A-Za-z]+:[^|<>]*)*)>", re.ASCII)
_POSITION = re.compile(rf"\|([MW])Pos:({_NUMBERS})(?=\||$)", re.ASCII)
_OFFSET = re.compile(rf"\|WCO:({_NUMBERS})(?=\||$)", re.ASCII)

Vector = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Report:
    """What a report says. Positions are in machine coordinates, mm or degrees."""

    state: str
    substate: int | None
    position: Vector | None
    """None while the offset of the work coordinates is not known yet."""

    @property
    def moving(self) -> bool:
        """Whether anything moves: a hold does until it has come to a stand (Hold:0)."""
        return self.state in MOVING or (self.state in {"Hold", "Door"} and self.substate not in {0, None})


class ReportReader:
    """Reads reports, and remembers the offset that only some of them carry."""

    def __init__(self) -> None:
        self._offset: Vector | None = None

    def forget(self) -> None:
        """Begin anew, as the controller does after a reset."""
        self._offset = None

    def read(self, line: str) -> Report | None:
        """Return what a line says, None where it is no whole report."""
        report = _REPORT.fullmatch(line)
        if report is None:
            return None
        state, substate, fields = report.groups()
        position = _POSITION.search(fields)
        if position is None:
            return None
        offset = _OFFSET.search(fields)
        if offset is not None:
            self._offset = _vector(offset[1])
        machine: Vector | None = _vector(position[2])
        if position[1] == "W":
            machine = self._in_machine_coordinates(_vector(position[2]))
        return Report(state, None if substate is None else int(substate), machine)

    def _in_machine_coordinates(self, work: Vector) -> Vector | None:
        if self._offset is None or len(self._offset) != len(work):
            return None
        return tuple(value + offset for value, offset in zip(work, self._offset, strict=True))


def _vector(text: str) -> Vector:
    return tuple(float(number) for number in text.split(","))
