"""What is wrong between this machine's devices and a rig, and what to do about it.

expected     the devices that a profile names
diagnosis    what is there, what is wrong, and the remedy
"""

from daemon.doctor.diagnosis import Diagnosis, Problem, examine

__all__ = ["Diagnosis", "Problem", "examine"]
