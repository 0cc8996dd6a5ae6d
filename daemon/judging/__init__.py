"""Whether a calibration is good: what a person asks of a run's views and of stored calibrations, answered from disk.

judge         who asks the store;  kept  what was made of it, for who asks again
sightings     the target in a run's pictures, as the run found it or looked for once
views         a run's views, each with how well it agrees
"""

from daemon.judging.judge import Judge
from daemon.judging.sightings import Sightings

__all__ = ["Judge", "Sightings"]
