"""Text of others reaches the page as data: what the page parses, or runs, is a literal."""

import ast
from pathlib import Path

MODULES = sorted((Path(__file__).parents[3] / "stickslip_ros/app/dashboard").glob("*.py"))

PARSED = {
    *("props", "style", "classes", "html", "markdown", "code", "mermaid", "restructured_text"),
    *("add_head_html", "add_body_html", "add_css", "add_slot", "run_javascript"),
}
"""Methods of NiceGUI whose arguments are props, HTML, a template or a script."""

PAGE_JS = ast.unparse(
    ast.parse(
        "ui.run_javascript(f\"stickslip.{function}({', '.join(map(json.dumps, arguments))})\")"
    )
)
"""The one exception: a function of page.js, with JSON as its arguments."""


def offences(code: str) -> list[str]:
    """Return the calls in which something else than a literal is parsed or run."""
    found: list[str] = []
    for call in [node for node in ast.walk(ast.parse(code)) if isinstance(node, ast.Call)]:
        name = call.func.attr if isinstance(call.func, ast.Attribute) else ""
        given = call.args if name in PARSED else []
        given += [k.value for k in call.keywords if k.arg == "js_handler"]
        if not all(isinstance(each, ast.Constant) for each in given):
            found.append(ast.unparse(call))
    return [each for each in found if each != PAGE_JS]


def test_only_literals_are_parsed_and_text_comes_as_json() -> None:
    texts = {path.name: path.read_text(encoding="utf-8") for path in MODULES}
    assert {name: offences(text) for name, text in texts.items()} == {name: [] for name in texts}
    assert [name for name, text in texts.items() if PAGE_JS in ast.unparse(ast.parse(text))] == [
        "elements.py"
    ]


def test_what_parses_text_is_noticed() -> None:
    for code in (
        "element.props(f'label=\"{name}\"')",
        "element.style('color: ' + colour)",
        "ui.html(text)",
        "ui.run_javascript(f'show({name!r})')",
        "element.on('click', js_handler=f'() => show({name})')",
    ):
        assert offences(code), code
