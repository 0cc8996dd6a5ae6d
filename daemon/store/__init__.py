"""What outlives the daemon: runs and calibrations in SQLite, session folders beside them.

In the order in which a record comes out:

    tables     what is kept;  records  what is given out
    database   the file, its durability, its version, its thread;  migrations  from older versions
    answers    what requests with an idempotency key were answered
    copies     the database as it is at one moment;  folder_lock  one activecam a folder
    store      questions and changes, one transaction each;  keys, audit  those of who may, and who did
"""

from daemon.store.records import CalibrationRecord, CalibrationSummary, RunRecord, RunState
from daemon.store.store import Store

__all__ = ["CalibrationRecord", "CalibrationSummary", "RunRecord", "RunState", "Store"]
