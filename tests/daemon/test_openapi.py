"""The API keeps to its own description, whatever is asked of it."""

import asyncio
import queue
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from typing import cast

import httpx
import pytest
import schemathesis
from hypothesis import HealthCheck, given, settings
from schemathesis import Case
from schemathesis.checks import not_a_server_error
from schemathesis.schemas import APIOperation
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_schema_conformance,
    status_code_conformance,
    unsupported_method,
)

from daemon.api import create_app
from daemon.server import address_of, bind, serving
from daemon.service import Service, running_service
from tests.daemon.rigs import small_rig

CHECKS = [
    not_a_server_error,
    status_code_conformance,
    content_type_conformance,
    response_schema_conformance,
    unsupported_method,
]


@dataclass(frozen=True)
class Served:
    """A service in another thread's loop, and where it is reached."""

    address: str
    service: Service
    loop: asyncio.AbstractEventLoop

    def free_to_move(self) -> None:
        """End whatever run and lease the questions before have begun."""

        async def free() -> None:
            await self.service.runs.close()
            self.service.leases.close()
            self.service.rig.acknowledge_stop()

        asyncio.run_coroutine_threadsafe(free(), self.loop).result(60)


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """A calibrated rig, served from a thread of its own, since schemathesis asks synchronously."""
    folder = tmp_path_factory.mktemp("openapi")
    over = asyncio.Event()
    served: queue.Queue[Served] = queue.Queue()
    listening = bind("127.0.0.1", 0)

    async def serve() -> None:
        async with running_service(small_rig(folder), folder / "data") as service:
            await service.runs.wait((await service.runs.start()).id)
            async with serving(service, listening):
                served.put(Served(address_of(listening), service, asyncio.get_running_loop()))
                await over.wait()

    thread = threading.Thread(target=asyncio.run, args=(serve(),))
    thread.start()
    rig = served.get(timeout=60)
    yield rig
    rig.loop.call_soon_threadsafe(over.set)
    thread.join()
    listening.close()


def operations() -> list[APIOperation]:
    """All operations but the streams, which end with what they show."""
    description = create_app(cast(Service, None)).openapi()  # describing asks nothing of the service
    found = schemathesis.openapi.from_dict(description).exclude(path_regex=r"/events$|/stream\.mjpg$")
    return [result.ok() for result in found.get_all_operations()]


ask_anything = settings(
    max_examples=15,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much],
)


@pytest.mark.parametrize("operation", operations(), ids=lambda operation: operation.label)
def test_every_answer_is_as_described(operation: APIOperation, rig: Served) -> None:
    @ask_anything
    @given(case=operation.as_strategy())
    def ask(case: Case) -> None:
        case.call_and_validate(base_url=rig.address, checks=CHECKS)

    ask()


@pytest.mark.parametrize(
    "operation", [o for o in operations() if "/axes/" in o.path], ids=lambda operation: operation.label
)
def test_so_is_every_answer_to_who_may_move(operation: APIOperation, rig: Served) -> None:
    rig.free_to_move()
    with httpx.Client(base_url=f"{rig.address}/api/v1") as client:
        lease = client.post("/lease", json={"owner": "schemathesis", "ttl_s": 60}).json()
        header = {"X-Lease": lease["token"]}
        codes = set()

        @ask_anything
        @given(case=operation.as_strategy())
        def ask(case: Case) -> None:
            case.headers.update(header)
            if "name" in case.path_parameters:
                case.path_parameters["name"] = "pan"
            codes.add(case.call_and_validate(base_url=rig.address, checks=CHECKS).status_code)

        ask()
        assert not codes & {401, 403}


def test_the_description_can_be_read_without_the_internet(rig: Served) -> None:
    document = httpx.get(f"{rig.address}/api/v1/openapi.json").json()
    page = httpx.get(f"{rig.address}/docs").text
    for path, operations in document["paths"].items():
        for method in operations:
            assert f"{method.upper()} {path}" in page
    assert "<script" not in page
    assert "//" not in page.replace("</", "")
    assert httpx.get(f"{rig.address}/docs").headers["content-type"].startswith("text/html")


def test_every_operation_is_described(rig: Served) -> None:
    document = httpx.get(f"{rig.address}/api/v1/openapi.json").json()
    tags = {tag["name"] for tag in document["tags"]}
    for path, operations in document["paths"].items():
        for method, operation in operations.items():
            where = f"{method} {path}"
            assert operation["summary"], where
            assert len(operation["description"]) > 20, where
            assert set(operation["tags"]) <= tags, where
    operation_ids = [op["operationId"] for ops in document["paths"].values() for op in ops.values()]
    assert len(set(operation_ids)) == len(operation_ids)
    move = document["paths"]["/api/v1/axes/{name}/move"]["post"]["responses"]
    assert set(move) == {"200", "202", "401", "403", "404", "409", "422", "503"}
    assert "`not_homed`" in move["409"]["description"]
