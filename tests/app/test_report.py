import json

import pytest

from stickslip_ros.app.main import main
from tests.bags.runs import STAMPS, record


@pytest.fixture
def command(capsys):
    """Call the entry script in this process; return exit status, output and error output."""

    def call(*arguments):
        with pytest.raises(SystemExit) as exit_:
            main([str(argument) for argument in arguments])
        return exit_.value.code, *capsys.readouterr()

    return call


def test_two_runs_are_set_side_by_side(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    record(tmp_path / "first")
    record(tmp_path / "second", states=STAMPS[:500])
    bags = "first", "second"
    status, out, _ = command("report", *bags)
    assert status == 0
    assert out.index("first") < out.index("second")
    row = next(line for line in out.splitlines() if "samples" in line)
    assert [cell.strip() for cell in row.split("│")[2:4]] == ["1000", "500"]
    status, out, _ = command("report", *bags, "--json", "--from", "1", "--to", "4")
    reports = json.loads(out)["reports"]
    assert [report["bag"] for report in reports] == ["first", "second"]
    assert [report["samples"] for report in reports] == [300, 300]


def test_what_is_missing_is_said(command, tmp_path):
    record(tmp_path / "bag")
    (tmp_path / "bag" / "metadata.yaml").unlink()
    status, out, _ = command("report", tmp_path / "bag")
    assert status == 0
    assert out.splitlines()[-1].startswith("metadata.yaml is missing")


def test_a_damaged_bag_is_repaired(command, tmp_path):
    record(tmp_path / "bag")
    file = tmp_path / "bag" / "bag_0.mcap"
    cut = file.read_bytes()[:-3000]
    file.write_bytes(cut)
    before = json.loads(command("report", tmp_path / "bag", "--json")[1])
    status, out, _ = command("repair", tmp_path / "bag", tmp_path / "sound")
    assert status == 0
    assert "does not end as it should" in out
    after = json.loads(command("report", tmp_path / "sound", "--json")[1])
    assert not before["complete"]
    assert after["complete"]
    same = before.keys() - {"complete", "missing", "bag"}
    assert {key: after[key] for key in same} == {key: before[key] for key in same}
    assert file.read_bytes() == cut
    status, out, _ = command("repair", tmp_path / "sound", tmp_path / "again", "--json")
    assert json.loads(out)["missing"] == []


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["report", "nothing"], "the bag nothing does not exist"),
        (["report", "bag", "--namespace", "/other"], "no joint_states and no control_force in"),
        (["report", "bag", "--from", "50"], "from 50.0 s to inf s of bag holds no samples"),
        (["report", "bag", "--from", "1e300"], "from 1e+300 s to inf s"),
        (["report", "bag", "--from", "-1"], "'-1' is not a time in seconds"),
        (["report", "text"], "not an MCAP file"),
        (["repair", "bag"], "OUT"),
        (["repair", "bag", "bag"], "exists already"),
        (["repair", "bag", "bag/inside"], "would lie within bag"),
        (["repair", "text", "out"], "not an MCAP file"),
        (["repair", "empty", "out"], "holds no .mcap file"),
        (["repair", "bag", "text/out"], "not a directory"),
    ],
)
def test_what_cannot_be_is_refused_in_a_line(command, tmp_path, monkeypatch, arguments, complaint):
    monkeypatch.chdir(tmp_path)
    record(tmp_path / "bag")
    (tmp_path / "text").write_text("these are not the bytes of a bag")
    (tmp_path / "empty").mkdir()
    status, out, error = command(*arguments)
    assert (status, out) == (2, "")
    assert complaint in error.splitlines()[-1]
    assert not (tmp_path / "out").exists()
