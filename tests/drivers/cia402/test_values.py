"""Values of a drive that answers late, and then twice."""

from types import SimpleNamespace

import pytest
from canopen.sdo import SdoCommunicationError

from drivers.cia402 import objects
from drivers.cia402.values import Values
from drivers.errors import DeviceLostError


class Variable:
    """An object of a drive whose first answers are not what was asked for."""

    def __init__(self, *errors: str) -> None:
        self._errors = list(errors)
        self.asked = 0

    @property
    def raw(self) -> int:
        self.asked += 1
        if self._errors:
            raise SdoCommunicationError(self._errors.pop(0))
        return 402


def values_of(variable: Variable) -> Values:
    return Values("the drive", SimpleNamespace(sdo={objects.DEVICE_TYPE.index: variable}))


def test_the_answer_to_an_earlier_request_is_not_taken_for_silence() -> None:
    variable = Variable("Unexpected response 0x60", "Node returned a value for 0x6041 instead")
    assert values_of(variable).read(objects.DEVICE_TYPE) == 402
    assert variable.asked == 3


def test_silence_is_not_asked_again() -> None:
    variable = Variable("No SDO response received")
    with pytest.raises(DeviceLostError, match="the drive does not answer"):
        values_of(variable).read(objects.DEVICE_TYPE)
    assert variable.asked == 1


def test_a_node_that_never_answers_what_was_asked_is_lost() -> None:
    variable = Variable(*["Unexpected response 0x60"] * 9)
    with pytest.raises(DeviceLostError):
        values_of(variable).read(objects.DEVICE_TYPE)
    assert variable.asked == 3
