"""An hour of back-to-back runs with clients that come and go: `python -m tests.daemon.soak MINUTES [SEED]`.

daemon     the daemon, in a process of its own, which says what it takes
clients    what asks it, reads from it, and leaves without a word
verdict    whether that is what it took at first
__main__   all of it, with the figures of each minute
"""
