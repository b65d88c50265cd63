"""Tables of text, for terminals and notebooks."""

from xml.etree import ElementTree

from stickslip_ros.tables import TextTable


def test_html_holds_the_cells_whatever_is_in_them() -> None:
    table = TextTable("a < b & \x1b", ["", "<script>"], [["x & y", "1 µm"], ["机床", "\n"]])
    root = ElementTree.fromstring(table.html())
    assert root.findtext("caption") == "a < b & \\x1b"
    assert [cell.text for cell in root.iter("th")] == [None, "<script>"]
    rows = [[cell.text for cell in row] for row in root.findall("tbody/tr")]
    assert rows == [["x & y", "1 µm"], ["机床", "\\n"]]
