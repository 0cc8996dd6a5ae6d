"""The calibration run: measured, solved, verified, stored and activated, and told as events.

In the order in which a run goes:

    manager       one run at a time, under its own lease;  run_book  what is known of all of them
    beginning     what is kept of it from then on
    run           its states, from its start to its last word;  gate  where it waits while paused
    plan          what it would do, and how long that takes;  checklist  is all as it should be?
    assignment    what it has to do: measure and solve, or solve what there is
    survey        homing, sweeps and free views;  observation  one view;  unseen  those that show no target
    remarks       what is told of views
    measured      what is on disk of it, read back
    conclusion    solving and verification;  worker  a thread for them that can be abandoned
    events        what it tells;  event_log  told in order, kept, followed;  event_file  their lines on disk
"""

from daemon.procedure.events import RunEvent
from daemon.procedure.manager import RunManager
from daemon.procedure.run import Run

__all__ = ["Run", "RunEvent", "RunManager"]
