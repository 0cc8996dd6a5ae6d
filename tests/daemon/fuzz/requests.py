"""What clients ask for: requests at random, sensible and not."""

from dataclasses import dataclass, field
from typing import Any

from hypothesis import strategies as st

CLIENTS = ("anna", "ben")


@dataclass(frozen=True)
class Request:
    """`{run}` and `{calibration}` in `path` stand for one of those that there are; `shows` for whose token is shown."""

    method: str
    path: str
    body: dict[str, Any] | None = None
    shows: str | None = None
    waits: bool = False
    which: int = field(default=0, repr=False)
    """Of the runs and calibrations that there are, counted from the newest."""


axes = st.sampled_from(["slide", "pan"])
whose = st.sampled_from(["anna", *CLIENTS, None])
ttls = st.sampled_from([0.1, 0.5, 2.0, 60.0])


def _motions(name: str, target: float, shows: str | None, waits: bool) -> st.SearchStrategy[Request]:
    one, body = f"/axes/{name}", {"target": target}
    both = {"targets": {"slide": abs(target), "pan": target / 2}}
    return st.sampled_from(
        [
            Request("POST", f"{one}/home", None, shows, waits),
            Request("POST", f"{one}/move", body, shows, waits),
            Request("POST", f"{one}/jog", {"distance": target}, shows, waits),
            Request("POST", "/axes/move", both, shows, waits),
        ]
    )


leases = st.builds(
    lambda who, ttl, over: Request("POST", "/lease", {"owner": who, "ttl_s": ttl, "take_over": over}, who),
    st.sampled_from(CLIENTS),
    ttls,
    st.booleans(),
)
releases = st.builds(lambda who: Request("DELETE", "/lease", None, who), whose)
targets = st.sampled_from([0.0, 1.0, -5.0, 12.0, 40.0, 90.0])
motions = st.tuples(axes, targets, whose, st.booleans()).flatmap(lambda drawn: _motions(*drawn))
stops = st.sampled_from(
    [Request("POST", "/stop"), Request("POST", "/axes/slide/stop"), Request("POST", "/axes/pan/stop")]
)
acknowledgements = st.just(Request("POST", "/stop/acknowledge"))
starts = st.builds(lambda who: Request("POST", "/runs", {"owner": who or ""}, who), whose)
steering = st.builds(
    lambda what, who, which: Request("POST", f"/runs/{{run}}/{what}", None, who, which=which),
    st.sampled_from(["pause", "resume", "cancel", "solve"]),
    whose,
    st.sampled_from([0, 0, 0, 1]),
)
activations = st.builds(
    lambda which: Request("POST", "/calibrations/{calibration}/activate", which=which), st.integers(0, 2)
)
keyed = st.one_of(leases, releases, motions, starts)
"""Requests that are carried out once where they have a key, however often they are sent."""
reading = st.sampled_from(
    [Request("GET", path) for path in ("/pose", "/rig", "/health", "/runs", "/calibrations", "/runs/{run}")]
)

anything = st.one_of(
    leases,
    releases,
    motions,
    motions,
    stops,
    acknowledgements,
    starts,
    steering,
    steering,
    activations,
    reading,
)
