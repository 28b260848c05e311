"""Types reach into compiled functions: each parameter and result says what it is."""

import ast

import pytest
from test_layers import FOLDERS, ROOT


def compiled_functions(tree):
    """Functions that `compiled` makes machine code of, as a decorator or by a call."""
    functions = {node.name: node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
    for function in functions.values():
        if any(is_compiled(decorator) for decorator in function.decorator_list):
            yield function
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and is_compiled(node.func):
            names = [argument.id for argument in node.args if isinstance(argument, ast.Name)]
            yield from (functions[name] for name in names if name in functions)


def is_compiled(node):
    """Whether an expression is the name `compiled`, alone or behind its module."""
    return getattr(node, "id", getattr(node, "attr", None)) == "compiled"


def untyped(function):
    """Parameters, and "return", that have no type or one in which `Any` stands."""
    parameters = [argument for argument in ast.walk(function.args) if isinstance(argument, ast.arg)]
    types = {argument.arg: argument.annotation for argument in parameters}
    types["return"] = function.returns
    return [name for name, kind in types.items() if kind is None or "Any" in words(kind)]


def words(annotation):
    """Names in an annotation."""
    for node in ast.walk(annotation):
        if isinstance(node, ast.Name):
            yield node.id
        elif isinstance(node, ast.Attribute):
            yield node.attr


@pytest.mark.parametrize("package", ["cassie_control", "cassie_gaits"])
def test_compiled_functions_have_types(package):
    found = [
        (f"{path.relative_to(ROOT)}: {function.name}", untyped(function))
        for path in FOLDERS[package].rglob("*.py")
        for function in compiled_functions(ast.parse(path.read_text(encoding="utf-8")))
    ]
    assert len(found) > 10
    assert not [(name, parameters) for name, parameters in found if parameters]


def test_the_reader_of_types_sees_them():
    tree = ast.parse(
        "@compiled\ndef f(a: Any, b: dict[str, typing.Any], c, d: float) -> None: ...\n"
        "@compiled\ndef g(a: FloatArray) -> float: ...\n"
        "def h(a: float) -> Any: ...\n"
        "def other(a: Any) -> Any: ...\n"
        "run = compiled(h, nogil=True)\n"
    )
    found = {function.name: untyped(function) for function in compiled_functions(tree)}
    assert found == {"f": ["a", "b", "c"], "g": [], "h": ["return"]}
