"""What the options of every driver have in common."""

from pydantic import BaseModel, ConfigDict


class DriverOptions(BaseModel):
    """Base of a driver's option models: frozen, and an unknown key is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, defer_build=True)
