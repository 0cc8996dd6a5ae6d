"""CiA 402 drives without the drives, on a real python-can bus.

    servo     the power state machine and the motions of one motor
    node      the CANopen device around it: objects, SDO, PDO, NMT, heartbeat, emergencies
    adapter   a USB adapter that speaks `slcan` on a pseudo-terminal
    emulator  the bus with its nodes, and what goes wrong on request

Nothing is taken from `drivers.cia402`: a mistake there shall not be made here as well.
"""
