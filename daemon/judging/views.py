"""A run's views, each with how well it agrees: with a calibration, or before there is one, with itself."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from datetime import datetime

from calib import Calibration, Session
from calib.observations import Observed
from daemon.procedure import RunEvent


@dataclass(frozen=True, slots=True)
class JudgedView:
    """A view. What is None is not known, or not yet."""

    number: int
    """Its place in the session, from 0."""
    joint: str | None
    use: str
    readings: list[float]
    taken_at: datetime | None
    image: str | None
    points: int | None
    """Target points found in it."""
    residual_px: float | None = None
    """By how much they miss where they should be (rms)."""
    held_out_px: float | None = None
    """The same, against the fit of all other views."""
    set_aside: bool = False
    """Whether the fit left it out because it does not agree with the others."""
    left_out: bool = False
    """Whether a person did."""


def views_by_calibration(
    session: Session, calibration: Calibration, events: Iterable[RunEvent]
) -> list[JudgedView]:
    """Return the views of `session` as `calibration`, solved from them, says of them; `events` are their run's."""
    points = {event.view: event.points for event in events if event.type == "view"}
    judged = [_unjudged(session, number, points.get(number)) for number in range(len(session.views))]
    for view in calibration.quality.views:
        if view.view < len(judged):
            judged[view.view] = replace(
                judged[view.view],
                residual_px=view.rms_px,
                held_out_px=view.held_out_px,
                set_aside=view.set_aside,
                left_out=view.use == "none",
            )
    return judged


def views_by_themselves(session: Session, observed: Observed) -> list[JudgedView]:
    """Return the views of a session that is not solved (yet)."""
    from calib.own_fit import own_fits  # it brings the solver, which a daemon that serves poses does without

    fits = own_fits(session, observed.observations)
    points = {observation.view: len(observation.ids) for observation in observed.observations}
    return [
        replace(_unjudged(session, number, points.get(number, 0)), residual_px=fits.get(number))
        for number in range(len(session.views))
    ]


def _unjudged(session: Session, number: int, points: int | None) -> JudgedView:
    view = session.views[number]
    time = (view.model_extra or {}).get("time")
    return JudgedView(
        number=number,
        joint=view.joint,
        use=view.use,
        readings=list(view.readings),
        taken_at=None if time is None else datetime.fromisoformat(time),
        image=view.image,
        points=points,
    )
