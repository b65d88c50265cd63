"""Processes that read files of other tools."""

from contextlib import nullcontext
from pathlib import Path

import pytest

from stickslip_ros.record.limited_process import result_of

READER = """
import atexit
import os

from stickslip_ros.record.limited_process import limited

atexit.register(os.abort)
with limited("install it"):
    print("a row")
    {last}
"""
"""A library of it aborts a process that ends in order, as threads of pyarrow do at times."""


@pytest.mark.process
@pytest.mark.parametrize(
    ("last", "refused"), [("pass", None), ("raise KeyError", "it is damaged: KeyError")]
)
def test_a_library_that_aborts_at_the_end_does_not_change_the_result(
    last: str, refused: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "reader.py").write_text(READER.format(last=last))
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ValueError, match=f"^{refused}$") if refused else nullcontext():
        assert result_of("reader", seconds=60.0) == (b"a row\n", [])
