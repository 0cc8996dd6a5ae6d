"""Tables of steppers on a serial line: Grbl 1.1, and what speaks it (grblHAL, FluidNC).

options     what a profile may say
words       alarms and errors, by their numbers
status      reports, and positions from them
port        bytes in and out
link        lines and their answers, resets and alarms
settings    the controller's own settings, held against the profile
machine     the controller behind the axes
axis        one of them
controller  the driver
"""

from drivers.grbl.controller import GrblController

__all__ = ["GrblController"]
