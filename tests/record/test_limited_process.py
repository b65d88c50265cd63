"""Processes that read files of other tools."""

from pathlib import Path

import pytest

from stickslip_ros.record.limited_process import result_of

READER = """
import atexit
import os

from stickslip_ros.record.limited_process import limited

atexit.register(os.abort)
with limited("a library is missing"):
    print("a row")
    {last}
"""
"""A library of it aborts a process that ends in order, as threads of pyarrow do at times."""


@pytest.mark.process
@pytest.mark.parametrize(
    ("last", "refused"),
    [
        ("pass", None),
        ("raise KeyError('x')", "it is damaged: KeyError"),
        ("import no_library", "a library is missing"),
        ("raise SystemExit('it has 3 columns')", "it has 3 columns"),
    ],
)
def test_a_library_that_aborts_at_the_end_does_not_change_the_result(
    last: str, refused: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "reader.py").write_text(READER.format(last=last))
    monkeypatch.syspath_prepend(tmp_path)
    if refused is None:
        assert result_of("reader", seconds=60.0) == (b"a row\n", [])
        return
    with pytest.raises(ValueError, match=f"^{refused}$"):
        result_of("reader", seconds=60.0)
