"""Keys of the plant's diagnostics that other parts of the package read."""

NEWEST_STAMP = "newest_stamp"
"""Key of the stamp of the newest sample, ns, in the diagnostics."""
FAILURE = "failure"
"""Key of the reason why the plant could not continue, if it could not."""
FINISHED = "finished"
"""Key of whether the plant has paused by itself, not on request."""
