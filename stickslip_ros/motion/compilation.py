"""Compiled code is kept on disk: in heyoka's cache, but in one small enough to be opened quickly.

heyoka checks all of its cache when it opens it. The cache that it has by itself, for all programs,
grows up to 20 GiB: at 0.35 GB, opening it takes longer than to compile a drive.
"""

import fcntl
import os
from contextlib import closing
from functools import cache
from pathlib import Path
from typing import Any

import heyoka as hy

from stickslip_ros.files import user_cache

# heyoka warns on standard output, which is for results, where a marker's polynomial is only
# rounding, as in equilibrium.
hy.set_logger_level_error()

_MOST_KEPT = 32 * 2**20
"""Bytes that are kept: some 200 systems of equations, checked in 12 ms. The oldest go first."""

_DATABASE = "cache.db"


def compiled_integrator(*arguments: Any, **options: Any) -> Any:
    """Return heyoka's `taylor_adaptive` of these arguments."""
    _open_cache_once()
    return hy.taylor_adaptive(*arguments, **options)


def compiled_function(*arguments: Any, **options: Any) -> Any:
    """Return heyoka's `cfunc` of these arguments."""
    _open_cache_once()
    return hy.cfunc(*arguments, **options)


def open_cache() -> None:
    """Keep what is compiled in the user's cache, unless heyoka has been told where, or not to.

    Where that is not possible, as on a full disk, nothing is kept. What is read is run: a directory
    that others can write to is not used.
    """
    if os.environ.get("HEYOKA_CACHE_DIR") or not hy.llvm_state.get_diskcache_enabled():
        return
    try:
        folder = user_cache() / "compiled"
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = folder.stat()
        if status.st_uid != os.geteuid() or status.st_mode & 0o022:
            raise PermissionError(f"{folder} is not the user's alone")
        _open_database(folder)
    except (OSError, RuntimeError):  # the latter from heyoka, or for want of a home
        hy.llvm_state.set_diskcache_enabled(False)


_open_cache_once = cache(open_cache)


def _open_database(folder: Path) -> None:
    """Open the database in a folder, a new one if that is damaged; raise if that is not possible.

    None is removed while another process opens it: SQLite would mix the files of the two.
    """
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
        hy.llvm_state.set_diskcache_path(folder)
        try:
            hy.llvm_state.set_diskcache_limit(_MOST_KEPT)
        except RuntimeError:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if not _is_damaged(folder / _DATABASE):
                raise
            for file in folder.glob(f"{_DATABASE}*"):
                file.unlink()
            hy.llvm_state.set_diskcache_limit(_MOST_KEPT)


def _is_damaged(database: Path) -> bool:
    """Return whether SQLite finds a fault in a database, rather than in the disk or a lock."""
    import sqlite3  # rarely needed

    try:
        with closing(sqlite3.connect(f"{database.as_uri()}?mode=ro", uri=True)) as opened:
            return opened.execute("PRAGMA quick_check").fetchone() != ("ok",)
    except sqlite3.OperationalError:
        return False
    except sqlite3.DatabaseError:
        return True
