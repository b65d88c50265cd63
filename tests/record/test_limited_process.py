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
"""It is aborted at a normal exit, as it is at times by threads of pyarrow."""


@pytest.mark.process
@pytest.mark.parametrize(
    ("last", "refused"), [("pass", None), ("raise KeyError", "it is damaged: KeyError")]
)
def test_an_abort_at_exit_does_not_change_the_result(
    last: str, refused: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "reader.py").write_text(READER.format(last=last))
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ValueError, match=f"^{refused}$") if refused else nullcontext():
        assert result_of("reader", seconds=60.0) == (b"a row\n", [])
