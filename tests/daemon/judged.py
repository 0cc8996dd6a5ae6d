"""Asking what a calibration is judged by."""

from typing import Any

import httpx

from daemon.judging import Judge, Sightings
from daemon.service import Service


async def asked(client: httpx.AsyncClient, path: str, **query: Any) -> Any:
    answer = await client.get(path, params=query)
    assert answer.status_code == 200, answer.text
    return answer.json()


def forget(service: Service) -> None:
    """Know nothing of what runs have seen, as after a restart."""
    service.judge = Judge(service.store, service.runs, Sightings())
