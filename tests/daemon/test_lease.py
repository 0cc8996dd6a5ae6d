"""One lease on all motion: taken, shown, renewed, handed over, and ended."""

import asyncio
import contextlib
from functools import partial

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
    with desk.handing_over("run 1", "") as lease:
        assert lease.expires_at is None
    with pytest.raises(LeaseHeldError, match="'run 1' holds the motion lease: "):
        desk.acquire("anna", "", 60)


async def test_a_run_takes_its_starters(desk: LeaseDesk, ended: list[Lease]) -> None:
    mine = desk.acquire("anna", "", 60)
    with pytest.raises(LeaseHeldError), desk.handing_over("run 1", ""):
        pytest.fail("anna holds it")
    with desk.handing_over("run 1", "", mine.token):
        assert desk.require(mine.token) == mine
    assert ended == [mine]
    with pytest.raises(LeaseHeldError):
        desk.require(mine.token)


async def test_a_run_that_is_not_begun_after_all_leaves_its_starters(
    desk: LeaseDesk, ended: list[Lease]
) -> None:
    mine = desk.acquire("anna", "", 60)
    with pytest.raises(OSError, match="full"), desk.handing_over("run 1", "", mine.token):
        raise OSError("the disk is full")
    assert (desk.require(mine.token), ended) == (mine, [])


async def test_nobody_gets_one_while_a_run_is_begun(desk: LeaseDesk, ended: list[Lease]) -> None:
    mine = desk.acquire("anna", "", 0.01)
    over = asyncio.Event()
    desk.on_end(lambda _: over.set())
    with desk.handing_over("run 1", "", mine.token) as lease:
        await over.wait()
        for asked in (desk.acquire, desk.take_over):
            with pytest.raises(LeaseHeldError, match="'run 1' is about to hold the motion lease"):
                asked("ben", "", 60)
    assert (desk.current, ended) == (lease, [mine])


async def test_its_starter_renews_it_while_a_run_is_begun(desk: LeaseDesk) -> None:
    mine = desk.acquire("anna", "", 60)
    with contextlib.suppress(ZeroDivisionError), desk.handing_over("run 1", "", mine.token):
        desk.acquire("anna", "", 600, mine.token)
        raise ZeroDivisionError
    assert desk.require(mine.token).ttl == 600
    desk.close()


async def test_nothing_begins_under_one_that_is_over(service: Service) -> None:
    lease = service.leases.acquire("anna", "", 30.0)
    service.leases.release(lease.token)
    with pytest.raises(LeaseEndedError):
        await service.motions.begin(lease, ["slide"], partial(service.rig.jog, "slide", 1.0))
    assert not service.rig.snapshot.moving
