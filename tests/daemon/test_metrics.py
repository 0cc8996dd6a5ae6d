"""What Prometheus is told, in names by its conventions."""

import asyncio
import re
from pathlib import Path

import httpx
import pytest
from prometheus_client.parser import text_string_to_metric_families

from daemon.errors import StoreError
from daemon.operation import pulse
from daemon.service import Service
from tests.daemon.motions import home_all

Samples = dict[tuple[str, frozenset[tuple[str, str]]], float]


async def scrape(client: httpx.AsyncClient) -> Samples:
    answer = await client.get("http://localhost/metrics")
    assert answer.headers["content-type"] == "text/plain; version=0.0.4; charset=utf-8"
    families = text_string_to_metric_families(answer.text)
    return {(s.name, frozenset(s.labels.items())): s.value for family in families for s in family.samples}


def sample(samples: Samples, name: str, **labels: str) -> float | None:
    return samples.get((f"activecam_{name}", frozenset(labels.items())))


async def test_requests_are_counted_by_route_and_status(client: httpx.AsyncClient) -> None:
    await client.get("/pose")
    await client.get("/pose")
    await client.get("/runs/none")
    await client.get("/no/such/address")
    await client.request("BREW", "/pose")
    samples = await scrape(client)
    requests = "http_request_duration_seconds_count"
    assert sample(samples, requests, method="GET", route="/pose", status="409") == 2
    assert sample(samples, requests, method="GET", route="/runs/{run_id}", status="404") == 1
    assert sample(samples, requests, method="GET", route="none", status="404") == 1
    assert sample(samples, requests, method="other", route="none", status="405") == 1
    inf = sample(
        samples, "http_request_duration_seconds_bucket", method="GET", route="/pose", status="409", le="+Inf"
    )
    assert inf == 2


async def test_the_rig_and_its_work_are_shown(service: Service, client: httpx.AsyncClient) -> None:
    samples = await scrape(client)
    assert sample(samples, "axis_position", axis="pan", unit="deg") is None
    assert sample(samples, "axis_homed", axis="pan") == 0
    assert sample(samples, "runs_finished_total", state="succeeded") == 0
    run = await service.runs.start()
    assert sample(await scrape(client), "run_state", state="running") == 1
    await service.runs.wait(run.id)
    assert (await client.get("/pose")).status_code == 200
    assert (await client.post("/pose", json={"readings": [[0, 0], [1, 1]]})).status_code == 200
    samples = await scrape(client)
    position = service.rig.axis("pan").position
    assert sample(samples, "axis_position", axis="pan", unit="deg") == position
    assert sample(samples, "axis_homed", axis="pan") == 1
    assert sample(samples, "axis_fault", axis="pan") == 0
    assert sample(samples, "device_connected", device="main", kind="camera") == 1
    assert sample(samples, "device_reconnects_total", device="head", kind="controller") == 0
    assert sample(samples, "run_state", state="running") == 0
    assert sample(samples, "runs_finished_total", state="succeeded") == 1
    assert sample(samples, "view_duration_seconds_count") == 10
    assert sample(samples, "poses_total") == 3
    assert sample(samples, "calibrated") == 1
    assert sample(samples, "info", version=service.version, profile="small-rig") == 1
    for name in ("process_resident_memory_bytes", "process_open_fds", "process_start_time_seconds"):
        assert samples[name, frozenset()] > 0


async def test_errors_of_the_store_are_counted(
    service: Service, client: httpx.AsyncClient, tmp_path: Path
) -> None:
    await service.store._database.transact(lambda connection: connection.exec_driver_sql("DROP TABLE runs"))
    with pytest.raises(StoreError):
        await service.store.runs()
    assert sample(await scrape(client), "store_errors_total") == 1


async def test_the_lag_of_the_loop_is_watched(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pulse, "PERIOD", 0.0)
    lags: asyncio.Queue[float] = asyncio.Queue()
    watching = asyncio.create_task(pulse.watch_loop(lags.put_nowait))
    assert await lags.get() >= 0
    watching.cancel()
    await asyncio.gather(watching, return_exceptions=True)


async def test_names_and_units_are_as_prometheus_wants_them(
    service: Service, client: httpx.AsyncClient
) -> None:
    await home_all(service.rig)
    text = (await client.get("http://localhost/metrics")).text
    kinds = dict(re.findall(r"^# TYPE (\S+) (\S+)$", text, re.MULTILINE))
    helped = set(re.findall(r"^# HELP (\S+) \S", text, re.MULTILINE))
    assert set(kinds) == helped
    for name, kind in kinds.items():
        assert name.startswith(("activecam_", "process_"))
        assert name.endswith("_total") == (kind == "counter")
