"""The daemon among clients, devices and disks that do anything at any time.

effort         how much is tried
served         a rig that is served, for what is asked of the API
virtual_time   a loop on which waiting takes no time
adversary      devices and disks that go wrong when they are told to
requests       what clients ask for
watch          what must hold of motions and poses, whatever happens
watch_of_runs  what must hold of runs
"""
