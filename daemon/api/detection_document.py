"""What is seen of the target in a picture, as the API shows it."""

from datetime import datetime
from typing import Self

from pydantic import BaseModel, Field

from calib.detection import Fault, PictureHealth
from daemon.live_detection import Sighting


class DetectionDocument(BaseModel):
    """What is found of the target in one picture, and how good the picture is to measure in."""

    sequence: int = Field(description="The picture's number, as `X-Frame-Sequence` gives it.")
    taken_at: datetime = Field(description="When it was exposed.")
    found: bool
    problem: str | None = Field(description="Why the target was not found, in one sentence or two.")
    ids: list[int] = Field(description="The points found, by the target's own numbers.")
    pixels: list[list[float]] = Field(description="Where they are: x, y for each id.")
    health: PictureHealth | None = Field(description="How good the picture is, in numbers.")
    faults: list[Fault] = Field(description="What is wrong with it and what to do, what matters most first.")

    @classmethod
    def of(cls, sighting: Sighting) -> Self:
        """Describe a sighting."""
        look = sighting.inspection
        found = look.detection
        return cls(
            sequence=sighting.frame.sequence,
            taken_at=sighting.taken_at,
            found=found is not None,
            problem=look.problem,
            ids=[] if found is None else found.ids.tolist(),
            pixels=[] if found is None else found.pixels.tolist(),
            health=look.health,
            faults=list(look.faults),
        )
