"""What devices this machine has, without opening any but cameras, and those only to ask for their formats.

machine    whose eyes we look with: the root of the file system, the user and the groups
node       what there is to say of any device node: its lasting names, its identity on USB, who may and who does hold it
serial_ports, can_interfaces, cameras    what there is of each
"""
