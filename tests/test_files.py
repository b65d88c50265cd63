"""Reading regular files only, and writing files whole or not at all."""

import os
import signal
import stat
from pathlib import Path

import pytest

from stickslip_ros.files import open_regular, written


def test_only_a_regular_file_is_opened_through_a_link_too(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"text")
    (tmp_path / "link").symlink_to("file")
    with open_regular(tmp_path / "link") as file:
        assert file.read() == b"text"
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/zero"), tmp_path):
        with pytest.raises(OSError, match="not a regular file"):
            open_regular(path)


def test_another_name_of_a_file_is_refused_without_links(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    secret = tmp_path / "real" / "file"
    secret.write_bytes(b"secret")
    with open_regular(secret, links=False) as file:
        assert file.read() == b"secret"
    (tmp_path / "link").symlink_to(secret)
    (tmp_path / "directory").symlink_to("real")
    for path in (tmp_path / "link", tmp_path / "directory" / "file", tmp_path / "hard"):
        if path.name == "hard":
            path.hardlink_to(secret)
        with pytest.raises(OSError, match="it is a link"):
            open_regular(path, links=False)


def test_a_file_is_there_when_it_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "file"
    with written(path) as stream:
        stream.write("µ\r\n")
        stream.flush()
        assert not path.exists()
    assert path.read_bytes() == "µ\r\n".encode()
    umask = os.umask(0)
    os.umask(umask)
    assert stat.S_IMODE(path.stat().st_mode) == 0o666 & ~umask
    assert os.listdir(tmp_path) == ["file"]


def test_a_block_that_fails_changes_nothing(tmp_path: Path) -> None:
    old, new = tmp_path / "old", tmp_path / "new"
    old.write_text("old")
    for path in (old, new):
        with pytest.raises(KeyboardInterrupt):
            _write_half(path)
    assert os.listdir(tmp_path) == ["old"]
    assert old.read_text() == "old"


def test_an_interrupt_waits_until_what_follows_a_file_is_done(tmp_path: Path) -> None:
    done: list[None] = []

    def follow() -> None:
        signal.raise_signal(signal.SIGINT)
        done.append(None)

    with pytest.raises(KeyboardInterrupt), written(tmp_path / "file", then=follow):
        pass
    assert done
    assert os.listdir(tmp_path) == ["file"]


def test_a_file_that_came_in_between_is_left(tmp_path: Path) -> None:
    path = tmp_path / "file"
    file = written(path)
    file.__enter__().write("ours")
    path.write_text("of another")
    with pytest.raises(FileExistsError):
        file.__exit__(None, None, None)
    assert path.read_text() == "of another"
    assert os.listdir(tmp_path) == ["file"]


def test_a_link_stays_a_link_and_the_mode_of_its_file(tmp_path: Path) -> None:
    path, link = tmp_path / "file", tmp_path / "link"
    path.touch(0o600)
    link.symlink_to("file")
    with written(link, replace=True) as stream:
        stream.write("new")
    assert link.is_symlink()
    assert path.read_text() == "new"
    assert stat.S_IMODE(path.stat().st_mode) == 0o600


def _write_half(path: Path) -> None:
    with written(path, replace=True) as stream:
        stream.write("new")
        raise KeyboardInterrupt
