"""Seeing from outside how the daemon does, and telling whoever keeps it running.

log_fields   what a record of the log is about;  log_format  how it is written
figures      what is counted for Prometheus;  rig_figures  what is found of the service when it asks
pulse        how late the event loop is
store_check  whether the disk still takes what there is to keep
supervisor   what systemd is told
"""
