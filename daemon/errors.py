"""What the daemon can refuse or fail at, as one tree.

    DaemonError
    ├── RigError
    │   ├── UnknownAxisError (KeyError)        no axis of this name
    │   ├── StopLatchedError                   a stop has not been acknowledged: nothing may move
    │   ├── RigFaultError                      the rig is in fault: a run cannot start
    │   ├── TimeNotCoveredError                there are no readings of that time
    │   └── StandstillError                    axes that could not be confirmed to stand
    ├── LeaseError
    │   ├── LeaseRequiredError                 a motion asked without a lease
    │   ├── LeaseEndedError                    a motion asked with a lease that is over
    │   └── LeaseHeldError                     somebody else may move; the message says who
    ├── RunError
    │   ├── UnknownRunError (KeyError)         no run of this id
    │   ├── RunActiveError                     one run at a time, and one is under way
    │   ├── RunStateError                      the run is not in a state in which this can be asked
    │   ├── ProfileChangedError                the run was taken with another profile than the rig's
    │   ├── SessionUnreadableError             what the run has measured is gone or damaged
    │   ├── UnknownViewError (KeyError)        no view of this number
    │   └── TargetUnseenError                  the views that a run got are too few to go on
    ├── PoseError
    │   ├── NotCalibratedError                 no calibration is active
    │   ├── CalibrationMismatchError           the calibration is of another chain than the rig's
    │   ├── StaleReadingError                  the latest reading is too old to answer with
    │   ├── LensUnknownError                   the calibration does not know the camera's lens
    │   └── UnknownCameraError (KeyError)      no camera of this name in the calibration
    ├── StoreError                             the database or its folder cannot be used
    │   ├── FolderInUseError                   another activecam uses the data folder
    │   └── UnknownCalibrationError (KeyError) no calibration of this id
    ├── IdempotencyError
    │   ├── IdempotencyConflictError           this key was another request's
    │   ├── IdempotencyInProgressError         the first request of this key is still under way
    │   └── IdempotencyUnknownError            how the first request of this key ended is not known
    ├── ExportError
    │   ├── UnknownExportError (KeyError)      no export of this name
    │   └── ExportUnavailableError             this calibration cannot be had in this form
    ├── BackupError                            a backup that cannot be made, or not be restored
    ├── AccessError
    │   ├── KeyRequiredError                   a request without a key, where one is asked for
    │   ├── KeyUnknownError                    a key that was never one, or is none any more
    │   ├── RoleRequiredError                  a key whose role does not allow this
    │   ├── NoKeyError                         a key is asked for, and there is none
    │   ├── KeyNameError                       a name that no key can have
    │   ├── KeyExistsError                     there is a key of this name
    │   └── UnknownKeyError (KeyError)         there is no key of this name
    ├── PrintError                             a target that cannot be drawn as large, or as finely, as asked
    └── ServeError                             the address cannot be served

Every message is one sentence that says what happened and what to do.
"""

from collections.abc import Sequence


class DaemonError(Exception):
    """The daemon could not do what was asked of it."""

    def __str__(self) -> str:
        # KeyError quotes its message; a sentence is to be read as it is.
        return str(self.args[0]) if self.args else ""


class RigError(DaemonError):
    """The rig as a whole cannot do this now."""


class UnknownAxisError(RigError, KeyError):
    """The rig has no axis of this name."""


class StopLatchedError(RigError):
    """A stop is latched: nothing moves before somebody acknowledges it."""


class RigFaultError(RigError):
    """A device is lost or in fault, so that a run cannot be started."""


class TimeNotCoveredError(RigError):
    """There are no readings around the time that was asked for: it is to come, too long ago, or in a gap."""


class StandstillError(RigError):
    """A stop was sent, and some axis could not be confirmed to stand; the message says which and why."""

    def __init__(self, message: str, reasons: Sequence[str] = ()) -> None:
        """`reasons` are the drivers' sentences that the message has in it."""
        super().__init__(message)
        self.reasons = tuple(reasons)


class LeaseError(DaemonError):
    """Who may move is not who asked."""


class LeaseRequiredError(LeaseError):
    """A motion was asked without a lease."""


class LeaseEndedError(LeaseError):
    """The lease that was shown is unknown, released or expired."""


class LeaseHeldError(LeaseError):
    """Another client, or a run, holds the lease."""


class RunError(DaemonError):
    """A calibration run cannot be started, steered or finished."""


class UnknownRunError(RunError, KeyError):
    """There is no run of this id."""


class RunActiveError(RunError):
    """A run is under way, and there is one at a time."""


class RunStateError(RunError):
    """The run is over, already in the state that was asked for, or takes no more views between which it could rest."""


class ProfileChangedError(RunError):
    """A run cannot be resumed with another profile than it was begun with."""


class SessionUnreadableError(RunError):
    """What a run has measured is not on disk any more, or damaged."""


class UnknownViewError(RunError, KeyError):
    """A run has no view of this number."""


class TargetUnseenError(RunError):
    """The target was found at too few positions of a sweep for its joint to be determined."""


class PoseError(DaemonError):
    """The camera's pose cannot be given."""


class NotCalibratedError(PoseError):
    """No calibration is active."""


class CalibrationMismatchError(PoseError):
    """The calibration's joints are not the axes of this rig."""


class StaleReadingError(PoseError):
    """The latest reading is older than the profile allows, or there is none yet."""


class LensUnknownError(PoseError):
    """The active calibration knows where the camera is, but not its lens."""


class UnknownCameraError(PoseError, KeyError):
    """The active calibration has no camera of this name."""


class StoreError(DaemonError):
    """The database, or the folder it is in, cannot be used."""


class FolderInUseError(StoreError):
    """Another activecam uses the data folder."""


class UnknownCalibrationError(StoreError, KeyError):
    """There is no calibration of this id."""


class IdempotencyError(DaemonError):
    """A request cannot be answered as it was the first time."""


class IdempotencyConflictError(IdempotencyError):
    """Another request was sent with this key."""


class IdempotencyInProgressError(IdempotencyError):
    """The request of this key is still being carried out."""


class IdempotencyUnknownError(IdempotencyError):
    """The request of this key was begun, and the daemon ended before it was answered."""


class ExportError(DaemonError):
    """A calibration cannot be taken away in this form."""


class UnknownExportError(ExportError, KeyError):
    """There is no export of this name."""


class ExportUnavailableError(ExportError):
    """The calibration cannot be had in this form: its session is gone, or the format cannot say what it knows."""


class BackupError(DaemonError):
    """A backup cannot be written, is damaged, or cannot be restored where it was asked to."""


class AccessError(DaemonError):
    """Who asks may not do this, or the keys that tell are not as they need to be."""


class KeyRequiredError(AccessError):
    """A key is asked for, and none was shown."""


class KeyUnknownError(AccessError):
    """The key that was shown is none of those that there are."""


class RoleRequiredError(AccessError):
    """The key's role does not allow what was asked."""


class NoKeyError(AccessError):
    """A daemon that asks for a key is of no use without one."""


class KeyNameError(AccessError):
    """A key cannot have this name."""


class KeyExistsError(AccessError):
    """There is a key of this name already."""


class UnknownKeyError(AccessError, KeyError):
    """There is no key of this name."""


class PrintError(DaemonError):
    """The target does not fit on the paper, or the picture of it would be too large."""


class ServeError(DaemonError):
    """The daemon cannot listen where it was asked to."""
