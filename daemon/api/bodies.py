"""What the bodies of requests have in common."""

from pydantic import BaseModel, ConfigDict


class RequestBody(BaseModel):
    """A request's body, taken by the letter: whoever sends a key that means nothing here expects something."""

    model_config = ConfigDict(extra="forbid", strict=True)
