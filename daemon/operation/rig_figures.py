"""What Prometheus is told of the rig and of the daemon as they are when it asks."""

from collections.abc import Iterator, Sequence

from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from daemon.service import Service
from daemon.store import RunState

Samples = Sequence[tuple[tuple[str, ...], float]]
"""The values of labels, and a figure."""


class RigFigures(Collector):
    """The state of a service, as metrics."""

    def __init__(self, service: Service) -> None:
        self._service = service

    def collect(self) -> Iterator[Metric]:
        """Yield the metrics as they are now."""
        service = self._service
        yield _gauge(
            "info", "What runs here.", [((service.version, service.profile.name), 1)], "version", "profile"
        )
        yield from self._of_devices()
        yield from self._of_axes()
        yield from self._of_work()

    def _of_devices(self) -> Iterator[Metric]:
        devices = self._service.rig.snapshot.devices
        labels = [(device.name, device.kind) for device in devices]
        connected = [(each, device.lost is None) for each, device in zip(labels, devices, strict=True)]
        yield _gauge("device_connected", "Whether a device answers.", connected, "device", "kind")
        reconnects = [(each, device.reconnects) for each, device in zip(labels, devices, strict=True)]
        yield _counter(
            "device_reconnects", "How often a lost device was found again.", reconnects, "device", "kind"
        )

    def _of_axes(self) -> Iterator[Metric]:
        rig = self._service.rig
        axes = rig.snapshot.axes
        positions = [
            ((axis.spec.name, axis.spec.unit), axis.position) for axis in axes if axis.position is not None
        ]
        text = "Where an axis is, in its reading unit; absent while it does not know."
        yield _gauge("axis_position", text, positions, "axis", "unit")
        for name, text, values in (
            ("axis_homed", "Whether an axis knows where it is.", [axis.homed for axis in axes]),
            ("axis_moving", "Whether an axis moves.", [axis.moving for axis in axes]),
            (
                "axis_fault",
                "Whether an axis's device reports a fault.",
                [axis.fault is not None for axis in axes],
            ),
        ):
            named = [((axis.spec.name,), value) for axis, value in zip(axes, values, strict=True)]
            yield _gauge(name, text, named, "axis")
        age = rig.age(rig.snapshot)
        ages: Samples = [] if age is None else [((), age)]
        yield _gauge("reading_age_seconds", "Age of the oldest reading; absent before the first.", ages)
        yield _gauge("stop_latched", "Whether a stop waits to be acknowledged.", [((), rig.latch.engaged)])

    def _of_work(self) -> Iterator[Metric]:
        service = self._service
        run = service.runs.active
        state = None if run is None else run.record.state
        under_way = [((each.value,), each is state) for each in RunState if not each.over]
        yield _gauge("run_state", "Whether the run under way, if any, is in this state.", under_way, "state")
        yield _gauge("lease_held", "Whether somebody may move.", [((), service.leases.current is not None)])
        calibrated = service.poses.calibration_id is not None
        yield _gauge("calibrated", "Whether poses can be computed.", [((), calibrated)])
        fallen_back = service.fallback is not None
        yield _gauge(
            "calibration_fallback", "Whether the active calibration cannot be used.", [((), fallen_back)]
        )
        yield _gauge("streams", "Streams that clients follow.", [((), service.streams.open)])
        yield _counter(
            "store_errors", "How often the database could not be used.", [((), service.store.errors)]
        )


def _gauge(name: str, text: str, samples: Samples, *labels: str) -> Metric:
    family = GaugeMetricFamily(f"activecam_{name}", text, labels=labels)
    for values, value in samples:
        family.add_metric(values, value)
    return family


def _counter(name: str, text: str, samples: Samples, *labels: str) -> Metric:
    family = CounterMetricFamily(f"activecam_{name}", text, labels=labels)
    for values, value in samples:
        family.add_metric(values, value)
    return family
