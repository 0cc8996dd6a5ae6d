"""Whether all is there that the daemon's work needs."""

import asyncio
from typing import TYPE_CHECKING, Final

from daemon.errors import StoreError

if TYPE_CHECKING:
    from daemon.service import Service

PATIENCE: Final = 2.0
"""Seconds that the disk may take."""


async def missing(service: "Service") -> list[str]:
    """Return sentences on devices that are lost, a store that takes nothing, and a calibration that cannot be used."""
    sentences = [device.lost for device in service.rig.snapshot.devices if device.lost is not None]
    if service.fallback is not None:
        sentences.append(service.fallback.sentence)
    try:
        async with asyncio.timeout(PATIENCE):
            await service.store.check_writable()
    except StoreError as error:
        sentences.append(str(error))
    except TimeoutError:
        sentences.append(f"the database has taken nothing for {PATIENCE:g} s: is the disk there?")
    return sentences
