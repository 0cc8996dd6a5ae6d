"""The API's own description: complete, and readable where there is no internet."""

from collections.abc import Iterator

import httpx
import pytest

from tests.daemon.fuzz.served import Served, served


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    with served(tmp_path_factory.mktemp("openapi"), keys_asked=False) as rig:
        yield rig


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


def test_a_wrong_request_is_an_answer_where_there_is_something_to_check(rig: Served) -> None:
    paths = httpx.get(f"{rig.address}/api/v1/openapi.json").json()["paths"]
    for method, path in (("post", "stop"), ("get", "runs/{run_id}"), ("get", "calibrations/current")):
        assert "422" not in paths[f"/api/v1/{path}"][method]["responses"], path
    for method, path in (("post", "pose"), ("get", "camera/stream.mjpg"), ("delete", "lease")):
        assert "invalid_request" in paths[f"/api/v1/{path}"][method]["responses"]["422"]["description"], path
