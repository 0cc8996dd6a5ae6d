"""Routes of what a calibration can be taken away as."""

import contextlib
import json
from dataclasses import replace
from datetime import datetime
from typing import Annotated, Any, Final, Self

from fastapi import APIRouter, Path, Query, Response
from fastapi.responses import StreamingResponse
from pydantic import BaseModel, Field

from calib.errors import CalibError, FormatError
from daemon.api.calibrations import CalibrationId
from daemon.api.dependencies import ServiceDep
from daemon.api.problems import answers
from daemon.errors import (
    DaemonError,
    ExportUnavailableError,
    StoreError,
    UnknownCalibrationError,
    UnknownExportError,
    UnknownRunError,
)
from daemon.export import EXPORTS, Offer, Subject, axes_of, export_named, make, offer
from daemon.procedure.worker import in_worker
from daemon.service import Service

router = APIRouter(prefix="/calibrations/{calibration_id}/exports", tags=["calibrations"])

Camera = Annotated[
    str | None, Query(description="Whose lens, where the export is of one; the first camera's by default.")
]
FILES: Final[dict[str, Any]] = {
    export.media_type: {"schema": {"type": "string", "format": "binary"}} for export in EXPORTS
}


class ExportDocument(BaseModel):
    """What a calibration can be taken away as."""

    name: str = Field(examples=["rig.urdf"])
    media_type: str = Field(examples=["application/xml"])
    purpose: str = Field(description="What it is and what for.")
    size: int | None = Field(
        description="In bytes, of `session.zip` before packing; null where it is known once it has been made."
    )
    notes: list[str] = Field(description="What it cannot say of the calibration, in sentences.")
    problem: str | None = Field(description="Why it cannot be had of this calibration.")

    @classmethod
    def of(cls, offered: Offer) -> Self:
        """Describe an export."""
        export = offered.export
        return cls(
            name=export.name,
            media_type=export.media_type,
            purpose=export.purpose,
            size=offered.size,
            notes=offered.notes,
            problem=offered.problem,
        )


@router.get(
    "",
    summary="What a calibration can be taken away as",
    responses=answers(UnknownCalibrationError, FormatError, StoreError),
)
async def list_exports(
    calibration_id: CalibrationId, service: ServiceDep, camera: Camera = None
) -> list[ExportDocument]:
    """Answer with every export: what it is for, how large, what it leaves out, and why it cannot be had."""
    subject = await _subject(service, calibration_id)
    return await in_worker(lambda: [ExportDocument.of(offer(export, subject, camera)) for export in EXPORTS])


@router.get(
    "/{name}",
    summary="A calibration as a file that others read",
    response_class=Response,
    responses=answers(
        UnknownCalibrationError, UnknownExportError, ExportUnavailableError, FormatError, StoreError
    )
    | {200: {"description": "The file.", "content": FILES}},
)
async def get_export(
    calibration_id: CalibrationId,
    name: Annotated[str, Path(description="The file's name.", examples=["rig.urdf"])],
    service: ServiceDep,
    camera: Camera = None,
) -> Response:
    """Answer with the file, to be saved under its name and the time at which the calibration was made."""
    export = export_named(name)
    subject = await _subject(service, calibration_id)
    if export.looks:
        with contextlib.suppress(CalibError, DaemonError):  # the report says itself why it has none
            subject = replace(subject, misses=await service.judge.residuals(calibration_id))
    content = await in_worker(lambda: make(export, subject, camera))
    headers = {"Content-Disposition": f'attachment; filename="{_file_name(subject.made_at, name)}"'}
    if isinstance(content, bytes):
        return Response(content, media_type=export.media_type, headers=headers)
    return StreamingResponse(content, media_type=export.media_type, headers=headers)


async def _subject(service: Service, calibration_id: str) -> Subject:
    """Return what is stored of a calibration and of its run; raises UnknownCalibrationError and FormatError."""
    record = await service.store.calibration(calibration_id)
    run = None
    if record.run_id is not None:
        with contextlib.suppress(UnknownRunError):
            run = await service.store.run(record.run_id)
    known = Subject(
        calibration=record.read(),
        document=record.document.encode(),
        verification=record.verification,
        id=record.id,
        made_at=record.created_at,
    )
    if run is None:
        return known
    return replace(
        known,
        folder=service.store.session_folder(run),
        rig=run.profile_name,
        owner=run.owner,
        note=run.note,
        axes=axes_of(json.loads(run.profile)),
    )


def _file_name(made_at: datetime | None, name: str) -> str:
    return name if made_at is None else f"{made_at:%Y%m%d-%H%M%S}-{name}"
