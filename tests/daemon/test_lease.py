"""One lease on all motion: taken, shown, renewed, handed over, and ended."""

import asyncio

import pytest

from daemon.errors import LeaseEndedError, LeaseHeldError, LeaseRequiredError
from daemon.lease import Lease, LeaseDesk
from daemon.service import Service


@pytest.fixture
async def desk() -> LeaseDesk:
    return LeaseDesk()


@pytest.fixture
def ended(desk: LeaseDesk) -> list[Lease]:
    leases: list[Lease] = []
    desk.on_end(leases.append)
    return leases


async def test_the_holder_may_move_and_others_are_told_who_does(desk: LeaseDesk) -> None:
    lease = desk.acquire("anna", "aligning", 60)
    assert desk.require(lease.token) == lease
    with pytest.raises(LeaseHeldError, match=r"'anna' \(aligning\) holds the motion lease until"):
        desk.require("another token")
    with pytest.raises(LeaseHeldError):
        desk.acquire("ben", "", 60)
    with pytest.raises(LeaseRequiredError):
        desk.require(None)


async def test_its_token_renews_it(desk: LeaseDesk, ended: list[Lease]) -> None:
    lease = desk.acquire("anna", "", 60)
    renewed = desk.acquire("anna", "", 600, lease.token)
    assert renewed.token == lease.token
    assert renewed.expires_at is not None
    assert lease.expires_at is not None
    assert renewed.expires_at > lease.expires_at
    assert ended == []


async def test_it_expires(desk: LeaseDesk, ended: list[Lease]) -> None:
    lease = desk.acquire("anna", "", 0.01)
    over = asyncio.Event()
    desk.on_end(lambda _: over.set())
    await over.wait()
    assert ended == [lease]
    assert desk.current is None
    with pytest.raises(LeaseEndedError):
        desk.require(lease.token)
    desk.acquire("ben", "", 60)
    desk.close()


async def test_a_renewed_one_does_not_expire_at_its_first_end(desk: LeaseDesk, ended: list[Lease]) -> None:
    lease = desk.acquire("anna", "", 0.01)
    desk.acquire("anna", "", 60, lease.token)
    await asyncio.sleep(0.03)
    assert desk.require(lease.token).ttl == 60
    desk.close()
    assert len(ended) == 1


async def test_it_can_be_given_back(desk: LeaseDesk, ended: list[Lease]) -> None:
    lease = desk.acquire("anna", "", 60)
    desk.release(lease.token)
    assert ended == [lease]
    with pytest.raises(LeaseEndedError):
        desk.release(lease.token)


async def test_a_run_takes_a_free_one_and_keeps_it(desk: LeaseDesk) -> None:
    lease = desk.hand_over("run 1", "")
    assert lease.expires_at is None
    with pytest.raises(LeaseHeldError, match="'run 1' holds the motion lease: "):
        desk.acquire("anna", "", 60)


async def test_a_run_takes_its_starters(desk: LeaseDesk, ended: list[Lease]) -> None:
    mine = desk.acquire("anna", "", 60)
    with pytest.raises(LeaseHeldError):
        desk.hand_over("run 1", "")
    desk.hand_over("run 1", "", mine.token)
    assert ended == [mine]
    with pytest.raises(LeaseHeldError):
        desk.require(mine.token)


async def test_nothing_begins_under_one_that_is_over(service: Service) -> None:
    lease = service.leases.acquire("anna", "", 30.0)
    service.leases.release(lease.token)
    with pytest.raises(LeaseEndedError):
        await service.motions.begin(lease, ["slide"], service.rig.jog("slide", 1.0))
    assert not service.rig.snapshot.moving
