"""What can go wrong with a device, as one tree.

    DriverError
    ├── OptionsError (ValueError)          the profile asks for something the driver cannot do
    ├── DeviceLostError (ConnectionError)  not there, gone, or answering no more
    ├── DeviceTimeoutError (TimeoutError)  it is there but did not finish in time
    ├── LimitError (ValueError)            a target outside the axis's limits: nothing was moved
    ├── NotHomedError                      an absolute move of an axis whose position is unknown
    ├── AxisBusyError                      a motion asked of an axis that is already moving
    ├── MotionError                        the axis stands, but not where it was sent
    ├── MotionStoppedError                 a stop ended the motion before its target
    └── DeviceFaultError                   the device reports a fault of its own, which a person must clear

Every message is one sentence that names the device, says what happened in its units, and what to do.
"""


class DriverError(Exception):
    """A device could not do what was asked of it."""


class OptionsError(DriverError, ValueError):
    """A driver was given options it does not know or cannot fulfil."""


class DeviceLostError(DriverError, ConnectionError):
    """The device is not there, has gone, or no longer answers; its last reading must not be trusted."""


class DeviceTimeoutError(DriverError, TimeoutError):
    """The device is there but did not finish in the time the motion or exposure should take."""


class LimitError(DriverError, ValueError):
    """A target lies outside the limits of its axis; nothing was sent to the device."""


class NotHomedError(DriverError):
    """The axis does not know where it is, so that only homing and jogging are allowed."""


class AxisBusyError(DriverError):
    """The axis is already moving; the motion under way goes on, and nothing was sent to the device."""


class MotionError(DriverError):
    """The axis came to a standstill away from its target: stalled, blocked or slipped."""


class MotionStoppedError(DriverError):
    """A stop ended the motion before its target was reached."""


class DeviceFaultError(DriverError):
    """The device reports a fault of its own that has to be cleared before it moves again."""
