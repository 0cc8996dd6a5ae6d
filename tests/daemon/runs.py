"""Runs followed to their end."""

from typing import Any

from daemon.procedure import RunEvent
from daemon.service import Service
from daemon.store import RunRecord


async def finish(service: Service, run: RunRecord) -> tuple[RunRecord, list[RunEvent]]:
    events = [event async for event in service.runs.events(run.id)]
    return await service.runs.get(run.id), events


def of(events: list[RunEvent], kind: str) -> list[Any]:
    return [event for event in events if event.type == kind]
