"""What a run tells while it goes on, as typed events. Readings are in each axis's own unit."""

from datetime import UTC, datetime
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from daemon.store import RunState

Use = Literal["fit", "verify"]


class Event(BaseModel):
    """What all events carry. The log gives them their run and their number."""

    model_config = ConfigDict(frozen=True, defer_build=True)

    run_id: str = ""
    sequence: Annotated[int, Field(ge=0, description="Counts from 1 in each run.")] = 0
    time: datetime = Field(default_factory=lambda: datetime.now(UTC))


class StateChanged(Event):
    """The run was started, paused or resumed, or is solved as it is."""

    type: Literal["state"] = "state"
    state: RunState


class Planned(Event):
    """How much there is to do."""

    type: Literal["plan"] = "plan"
    views: Annotated[int, Field(description="Pictures to take in all.")]
    done: Annotated[int, Field(description="How many of them an earlier part of a resumed run took.")] = 0
    joints: Annotated[list[str], Field(description="The joints, in the order of their sweeps.")]


class Homing(Event):
    """An axis that does not know where it is looks for its zero."""

    type: Literal["homing"] = "homing"
    axis: str


class JointStarted(Event):
    """All axes go to a sweep's start, then the joint moves alone; without a joint, the free views begin."""

    type: Literal["joint"] = "joint"
    joint: str | None
    views: int
    use: Use | None = None


class Moving(Event):
    """The axes go to the position of a view."""

    type: Literal["moving"] = "moving"
    position: Annotated[int, Field(description="Counts the plan's positions from 1.")]
    of: int
    targets: dict[str, float]


class ViewTaken(Event):
    """A picture in which the target was found is on disk, or several of one view."""

    type: Literal["view"] = "view"
    position: int
    of: int
    view: Annotated[int, Field(description="Its place in the session, from 0.")]
    joint: str | None
    use: Use
    readings: list[float]
    points: Annotated[int, Field(description="Target points found in it.")]
    frames: Annotated[int, Field(description="Frames in which they were found, and averaged.")] = 1
    image: Annotated[str, Field(description="Its path in the session's folder.")]


class Warned(Event):
    """Something a person should know, with which the run goes on."""

    type: Literal["warning"] = "warning"
    message: str


class Solving(Event):
    """What the solver is doing."""

    type: Literal["solving"] = "solving"
    message: str


class Solved(Event):
    """The views are explained by a calibration."""

    type: Literal["solved"] = "solved"
    method: str
    quality: Annotated[dict[str, Any], Field(description="The calibration's quality, without its views.")]


class Verified(Event):
    """What the views that were held out say of the calibration."""

    type: Literal["verification"] = "verification"
    result: dict[str, Any]


class Finished(Event):
    """The run has come to its end; a run that is resumed or solved goes on, and has another."""

    type: Literal["finished"] = "finished"
    state: RunState
    error: Annotated[str | None, Field(description="Why it did not succeed, in one sentence.")] = None
    calibration_id: str | None = None


RunEvent = Annotated[
    StateChanged
    | Planned
    | Homing
    | JointStarted
    | Moving
    | ViewTaken
    | Warned
    | Solving
    | Solved
    | Verified
    | Finished,
    Field(discriminator="type"),
]
EVENT: TypeAdapter[RunEvent] = TypeAdapter(RunEvent, config=ConfigDict(defer_build=True))
