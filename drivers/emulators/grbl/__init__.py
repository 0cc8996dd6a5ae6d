"""A table of steppers on Grbl 1.1h, on a pseudo-terminal.

settings    what it keeps in its EEPROM
motor       a stepper: what is counted, and where the shaft is
machine     planner, hold, jog cancel, homing
gcode       the words of a line
firmware    what it says and obeys
emulator    the device of a profile, with its faults
"""

from drivers.emulators.grbl.emulator import GrblEmulator

__all__ = ["GrblEmulator"]
