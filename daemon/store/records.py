"""What the store gives out: records that no longer touch the database."""

import hashlib
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from typing import TYPE_CHECKING

from pydantic import ValidationError

from calib import Calibration
from calib.documents import first_problem
from calib.errors import FormatError

if TYPE_CHECKING:
    from calib.verification import Verification


class RunState(StrEnum):
    """Where a run stands."""

    RUNNING = "running"
    PAUSED = "paused"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    CANCELLED = "cancelled"
    INTERRUPTED = "interrupted"

    @property
    def over(self) -> bool:
        """Whether it will not change any more."""
        return self not in {RunState.RUNNING, RunState.PAUSED}


@dataclass(frozen=True, slots=True)
class RunRecord:
    """A calibration run as it is stored."""

    id: str
    state: RunState
    profile_name: str
    profile: str
    """The profile's document (JSON) when the run was created."""
    session: str
    """The session's folder, from the data folder."""
    owner: str
    note: str
    created_at: datetime
    started_at: datetime | None = None
    ended_at: datetime | None = None
    error: str | None = None
    calibration_id: str | None = None


def checksum_of(document: str) -> str:
    """Return the SHA-256 of a document, in hexadecimal digits."""
    return hashlib.sha256(document.encode()).hexdigest()


@dataclass(frozen=True, slots=True)
class StoredCalibration:
    """What a calibration is stored under."""

    id: str
    created_at: datetime
    method: str
    active: bool
    run_id: str | None


@dataclass(frozen=True, slots=True)
class CalibrationSummary(StoredCalibration):
    """A stored calibration without its document, but for its quality in one word and in a sentence."""

    judgement: str | None
    verdict: str | None


@dataclass(frozen=True, slots=True)
class CalibrationRecord(StoredCalibration):
    """A stored calibration."""

    document: str
    """The calibration's JSON."""
    verification: str | None = None
    """What the held-out views said (JSON), None where there were none."""
    checksum: str | None = None
    """The document's SHA-256 when it was stored, in hexadecimal digits; None where none was kept."""

    def read(self) -> Calibration:
        """Return the calibration; raises FormatError where its document is damaged, if only by a digit."""
        if self.checksum is not None and self.checksum != checksum_of(self.document):
            raise FormatError(f"calibration '{self.id}' is damaged: its document is not what was stored")
        try:
            return Calibration.model_validate_json(self.document)
        except ValidationError as error:
            raise FormatError(f"calibration '{self.id}' is damaged: {first_problem(error)}") from error

    def read_verification(self) -> "Verification | None":
        """Return what the held-out views said; raises FormatError where that is damaged."""
        from calib.verification import (
            VERIFICATION,
        )  # it brings the solver, which listing calibrations does without

        if self.verification is None:
            return None
        try:
            return VERIFICATION.validate_json(self.verification)
        except ValidationError as error:
            raise FormatError(f"calibration '{self.id}' is damaged: {first_problem(error)}") from error

    def summary(self) -> CalibrationSummary:
        """Return it without its document; raises FormatError where that is damaged."""
        quality = self.read().quality
        return CalibrationSummary(
            self.id,
            self.created_at,
            self.method,
            self.active,
            self.run_id,
            quality.judgement,
            quality.verdict,
        )
