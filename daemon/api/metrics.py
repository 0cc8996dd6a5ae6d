"""The daemon's figures for Prometheus, in its text format."""

from collections.abc import Iterator

from fastapi import APIRouter
from fastapi.responses import PlainTextResponse

from daemon.api.dependencies import ServiceDep
from daemon.service import Service

router = APIRouter(tags=["rig"])

Sample = tuple[dict[str, str], float]


@router.get("/metrics", summary="Figures for Prometheus", response_class=PlainTextResponse)
async def get_metrics(service: ServiceDep) -> PlainTextResponse:
    """Answer in the text exposition format, version 0.0.4."""
    text = "".join(_metrics(service))
    return PlainTextResponse(text, media_type="text/plain; version=0.0.4; charset=utf-8")


def _metrics(service: Service) -> Iterator[str]:
    rig, snapshot = service.rig, service.rig.snapshot
    axes = [({"axis": axis.spec.name}, axis) for axis in snapshot.axes]
    devices = [({"device": device.name, "kind": device.kind}, device) for device in snapshot.devices]
    info = {"version": service.version, "profile": service.profile.name}
    age = rig.age(snapshot)

    yield _metric("info", "gauge", "What runs here.", [(info, 1)])
    yield _metric(
        "start_time_seconds",
        "gauge",
        "When the daemon began (Unix time).",
        [({}, service.started_at.timestamp())],
    )
    yield _metric(
        "device_connected",
        "gauge",
        "Whether a device answers.",
        [(labels, device.lost is None) for labels, device in devices],
    )
    yield _metric(
        "device_reconnects_total",
        "counter",
        "How often a lost device was found again.",
        [(labels, device.reconnects) for labels, device in devices],
    )
    yield _metric(
        "axis_homed",
        "gauge",
        "Whether an axis knows where it is.",
        [(labels, axis.homed) for labels, axis in axes],
    )
    yield _metric(
        "axis_moving", "gauge", "Whether an axis moves.", [(labels, axis.moving) for labels, axis in axes]
    )
    yield _metric(
        "reading_age_seconds",
        "gauge",
        "Age of the oldest reading; absent before the first.",
        [] if age is None else [({}, age)],
    )
    yield _metric(
        "stop_latched", "gauge", "Whether a stop waits to be acknowledged.", [({}, rig.latch.engaged)]
    )
    yield _metric(
        "lease_held", "gauge", "Whether somebody may move.", [({}, service.leases.current is not None)]
    )
    yield _metric(
        "run_active", "gauge", "Whether a run is under way.", [({}, service.runs.active is not None)]
    )
    yield _metric(
        "calibrated",
        "gauge",
        "Whether a calibration is active.",
        [({}, service.poses.calibration_id is not None)],
    )
    yield _metric("streams", "gauge", "Streams that clients follow.", [({}, service.streams.open)])


def _metric(name: str, kind: str, text: str, samples: list[Sample]) -> str:
    lines = [f"# HELP activecam_{name} {text}", f"# TYPE activecam_{name} {kind}"]
    lines += [f"activecam_{name}{_labels(labels)} {float(value):.10g}" for labels, value in samples]
    return "\n".join(lines) + "\n"


def _labels(labels: dict[str, str]) -> str:
    written = ",".join(f'{key}="{_escaped(value)}"' for key, value in labels.items())
    return f"{{{written}}}" if written else ""


def _escaped(value: str) -> str:
    return value.replace("\\", r"\\").replace('"', r"\"").replace("\n", r"\n")
