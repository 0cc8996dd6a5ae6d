"""What is kept in a data folder, as one file to put elsewhere.

In the order in which data goes:

    manifest    what is in a backup, and how each file of it is told from a damaged one
    making      from a data folder, which a daemon may be using, to a backup
    archive     a backup, read and checked
    restoring   from a backup to a data folder
"""

from daemon.backup.making import make_backup
from daemon.backup.restoring import restore_backup

__all__ = ["make_backup", "restore_backup"]
