"""What is counted while the daemon works, for Prometheus."""

from typing import Final

from prometheus_client import CollectorRegistry, Counter, Histogram, ProcessCollector

from daemon.procedure import RunEvent
from daemon.store import RunState

REQUEST_BUCKETS: Final = (0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 10, 60)
VIEW_BUCKETS: Final = (0.1, 0.25, 0.5, 1, 2, 3, 5, 7.5, 10, 15, 30, 60, 120)
LAG_BUCKETS: Final = (0.001, 0.0025, 0.005, 0.01, 0.02, 0.05, 0.1, 0.25, 0.5, 1, 5)
"""Seconds."""


class Figures:
    """Counters and histograms of one daemon, with those of its process, in a registry of their own."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        ProcessCollector(registry=self.registry)
        self._requests = Histogram(
            "activecam_http_request_duration_seconds",
            "From a request's arrival to the head of its answer.",
            ("method", "route", "status"),
            buckets=REQUEST_BUCKETS,
            registry=self.registry,
        )
        self._views = Histogram(
            "activecam_view_duration_seconds",
            "From the move to a view's position until its pictures are on disk.",
            buckets=VIEW_BUCKETS,
            registry=self.registry,
        )
        self.poses = Counter("activecam_poses", "Poses that were given.", registry=self.registry)
        self._runs = Counter(
            "activecam_runs_finished", "Runs that ended.", ("state",), registry=self.registry
        )
        for state in RunState:
            if state.over:
                self._runs.labels(state)
        self.loop_lag = Histogram(
            "activecam_event_loop_lag_seconds",
            "How much later than asked for the event loop does something.",
            buckets=LAG_BUCKETS,
            registry=self.registry,
        )
        self._moves: dict[int, float] = {}
        """When the moves to the positions of the run under way began (Unix time)."""

    def answered(self, method: str, route: str, status: int, seconds: float) -> None:
        """Count a request."""
        self._requests.labels(method, route, str(status)).observe(seconds)

    def told(self, event: RunEvent) -> None:
        """Count what a run tells."""
        match event.type:
            case "moving":
                self._moves[event.position] = event.time.timestamp()
            case "view":
                began = self._moves.pop(event.position, None)
                if began is not None:
                    self._views.observe(event.time.timestamp() - began)
            case "finished":
                self._moves.clear()
                self._runs.labels(event.state).inc()
