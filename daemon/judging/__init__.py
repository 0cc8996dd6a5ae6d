"""Whether a calibration is good: what a person asks of a run's views and of stored calibrations, answered from disk.

judge         who asks the store;  kept  what was made of it, for who asks again
sightings     the target in a run's pictures, looked for once
views         a run's views, each with how well it agrees
"""

from daemon.judging.judge import Judge

__all__ = ["Judge"]
