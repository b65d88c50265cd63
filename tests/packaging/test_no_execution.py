"""The package does not execute, unpickle or expand the data that it reads."""

import ast
from pathlib import Path

PACKAGE = Path(__file__).parents[2] / "stickslip_ros"

EXECUTING_MODULES = {"code", "codeop", "dill", "joblib", "marshal", "pickle", "runpy", "shelve"}
EXECUTING_CALLS = {"__import__", "compile", "eval", "exec"}
EXECUTING_METHODS = {
    ("os", "popen"),
    ("os", "system"),
    ("yaml", "full_load"),
    ("yaml", "unsafe_load"),
    ("subprocess", "getoutput"),
    ("subprocess", "getstatusoutput"),
}
SAFE_LOADERS = {"_RosLoader", "yaml.BaseLoader", "yaml.CSafeLoader", "yaml.SafeLoader"}


def offences(tree: ast.AST) -> list[str]:
    """Return what in the code may execute data, one line each."""
    found: list[str] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            module = node.module if isinstance(node, ast.ImportFrom) else None
            names = [module or "", *(alias.name for alias in node.names)]
            found += [ast.unparse(node) for n in names if n.split(".")[0] in EXECUTING_MODULES]
        if isinstance(node, ast.Call) and not is_harmless(node):
            found.append(ast.unparse(node))
    return found


def is_harmless(call: ast.Call) -> bool:
    keywords = {k.arg: ast.unparse(k.value) for k in call.keywords}
    if "True" in (keywords.get("shell"), keywords.get("allow_pickle"), keywords.get("usetex")):
        return False
    if isinstance(call.func, ast.Name):
        return call.func.id not in EXECUTING_CALLS
    if not isinstance(call.func, ast.Attribute):
        return True
    method = (ast.unparse(call.func.value), call.func.attr)
    if method[0] == "yaml" and method[1] in ("load", "load_all"):
        positional = ast.unparse(call.args[1]) if len(call.args) > 1 else ""
        return keywords.get("Loader", positional) in SAFE_LOADERS
    return method not in EXECUTING_METHODS


def test_no_module_executes_data() -> None:
    modules = sorted(PACKAGE.rglob("*.py"))
    assert len(modules) > 100
    for module in modules:
        assert offences(ast.parse(module.read_text(encoding="utf-8"))) == [], module
