"""The code that is kept on disk: used again, bounded, private, and without it all goes on."""

import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from os import geteuid, stat_result
from pathlib import Path
from unittest import mock

import heyoka as hy
import pytest

from stickslip_ros.motion import compilation
from stickslip_ros.motion.compilation import compiled_function, open_cache
from tests.record.runs import full_disk

X = hy.make_vars("x")
STATE = hy.llvm_state


@pytest.fixture(autouse=True)
def database(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Have heyoka's cache anew in a directory of the test; return where its database is to be."""
    before = STATE.get_diskcache_path()
    monkeypatch.delenv("HEYOKA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    STATE.clear_memcache()
    yield tmp_path / "stickslip_ros" / "compiled" / "cache.db"
    STATE.set_diskcache_enabled(True)
    STATE.set_diskcache_path(before)


def computed() -> float:
    """Return a value of a function that is compiled as in another process."""
    STATE.clear_memcache()
    value: float = compiled_function([hy.sin(X) * 3.0], [X])([0.5])[0]
    return value


def close(database: Path) -> None:
    """Close the database: what locks SQLite's files does so for a process, not for a library."""
    STATE.set_diskcache_path(database.parent)


def kept(database: Path) -> dict[int, int]:
    """Return when each code that is kept was last used, by its key; uses are counted."""
    close(database)
    with closing(sqlite3.connect(database)) as opened:
        return dict(opened.execute("SELECT hash, last_access FROM cache").fetchall())


def test_what_was_compiled_is_used_again_to_the_last_bit(database: Path) -> None:
    open_cache()
    first, entries = computed(), kept(database)
    again, later = computed(), kept(database)
    assert again == first
    assert later.keys() == entries.keys()
    assert min(later.values()) > max(entries.values()) > 0
    assert STATE.get_diskcache_limit() == 32 << 20
    assert database.parent.stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("fault", ["other content", "cut off"])
def test_a_damaged_cache_is_written_anew(database: Path, fault: str) -> None:
    open_cache()
    value, entries = computed(), kept(database)
    content = database.read_bytes()
    database.write_bytes(b"x" * 5000 if fault == "other content" else content[: len(content) // 2])
    open_cache()
    assert computed() == value
    assert kept(database).keys() == entries.keys()


def test_on_a_full_disk_nothing_is_kept_and_nothing_lost(
    database: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    with full_disk(4096):
        open_cache()
        value = computed()
    assert not STATE.get_diskcache_enabled()
    STATE.set_diskcache_enabled(True)
    open_cache()
    assert computed() == value
    entries = kept(database)
    with full_disk(4096):
        open_cache()
    assert kept(database) == entries
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("whose", ["another user's", "of a group"])
def test_a_directory_that_others_can_write_to_is_not_read(database: Path, whose: str) -> None:
    folder = database.parent
    folder.mkdir(parents=True)
    if whose == "of a group":
        folder.chmod(0o770)
        open_cache()
    else:
        found = list(folder.stat())
        found[4] = geteuid() + 1
        with mock.patch.object(Path, "stat", return_value=stat_result(found)):
            open_cache()
    assert not STATE.get_diskcache_enabled()
    assert not list(folder.iterdir())


@pytest.mark.parametrize("place", ["/dev/null", "/proc/nothing"])
def test_without_a_place_nothing_is_kept(
    database: Path, place: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", place)
    open_cache()
    assert not STATE.get_diskcache_enabled()
    assert computed() == pytest.approx(1.4383, abs=1e-4)


def test_heyoka_keeps_it_where_it_was_told(database: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HEYOKA_CACHE_DIR", "/dev/null")
    open_cache()
    assert not database.parent.exists()


@pytest.mark.process
def test_processes_that_start_at_once_share_it(database: Path) -> None:
    program = f"""import heyoka as hy
from {compilation.__name__} import compiled_function
x = hy.make_vars("x")
for n in range(20):
    print(compiled_function([hy.sin(x) * n], [x])([0.5])[0])
"""
    started = [
        subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE) for _ in range(3)
    ]
    answers = {process.communicate()[0] for process in started}
    assert [process.returncode for process in started] == [0, 0, 0]
    assert len(answers) == 1
    open_cache()
    assert STATE.get_diskcache_enabled()
