"""The one exception that a user is meant to read.

Whatever is wrong with an input (a missing file, a truncated RAW, an unknown key, a full disk) is raised
as `FsidError` with one line that names the file or key and says what to do. The command line prints that
line and exits with code 2; any other exception is a bug in FSID and keeps its traceback.
"""


class FsidError(Exception):
    """Bad input. The message is one complete line for the user: what is wrong, where, what to do."""
