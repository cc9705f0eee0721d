"""The stubs name what the module has, with the parameters that it has, and everything is documented."""

import ast
import doctest
import inspect
import sys
from pathlib import Path

import pytest

import incise

STUBS = Path(incise.__file__).with_name("__init__.pyi")


def parameters(function):
    """Names, kinds and which of them have a default, from the stub of a function."""
    a = function.args
    positional = [(arg.arg, "positional") for arg in a.posonlyargs] + [(arg.arg, "any") for arg in a.args]
    defaults = [False] * (len(positional) - len(a.defaults)) + [True] * len(a.defaults)
    named = [(arg.arg, "keyword") for arg in a.kwonlyargs]
    defaults += [default is not None for default in a.kw_defaults]
    return [(*p, d) for p, d in zip(positional + named, defaults) if p[0] not in ("self", "cls")]


def present(function):
    """The same from the function itself."""
    kinds = {
        inspect.Parameter.POSITIONAL_ONLY: "positional",
        inspect.Parameter.POSITIONAL_OR_KEYWORD: "any",
        inspect.Parameter.KEYWORD_ONLY: "keyword",
    }
    found = inspect.signature(function).parameters.values()
    return [
        (p.name, kinds[p.kind], p.default is not inspect.Parameter.empty) for p in found if p.name not in ("self", "cls")
    ]


def public(names):
    return {name for name in names if not name.startswith("_")}


def test_the_wheel_has_stubs_and_a_mark_for_them():
    assert STUBS.is_file() and STUBS.with_name("py.typed").is_file()


def test_stubs_and_module_agree():
    tree = ast.parse(STUBS.read_text())
    classes = {node.name: node for node in tree.body if isinstance(node, ast.ClassDef)}
    functions = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}
    in_module = public(name for name in dir(incise) if name != "incise")
    assert public(classes) | public(functions) == in_module
    for name, stub in functions.items():
        assert parameters(stub) == present(getattr(incise, name)), name
    count = 0
    for name, stub in classes.items():
        if name.startswith("_"):
            continue
        kind = getattr(incise, name)
        members = {node.name: node for node in stub.body if isinstance(node, ast.FunctionDef)}
        assert public(members) == public(kind.__dict__), name
        # Python 3.9 has no signatures of constructors.
        if "__new__" in members and sys.version_info >= (3, 10):
            assert parameters(members["__new__"]) == present(kind), name
        for member, node in members.items():
            decorators = {getattr(d, "id", None) for d in node.decorator_list}
            if member.startswith("_") or "property" in decorators:
                continue
            count += 1
            assert parameters(node) == present(getattr(kind, member)), f"{name}.{member}"
    assert count > 50


def test_everything_is_documented():
    assert "NumPy" in incise.__doc__ or "Arrays" in incise.__doc__
    for name in public(dir(incise)):
        thing = getattr(incise, name)
        if name == "incise":
            continue
        assert thing.__doc__, name
        if inspect.isclass(thing):
            for member in public(thing.__dict__):
                assert getattr(thing, member).__doc__, f"{name}.{member}"


def test_the_example_of_the_module_runs():
    parsed = doctest.DocTestParser().get_doctest(incise.__doc__, {}, "incise", None, 0)
    assert len(parsed.examples) == 5
    assert doctest.DocTestRunner().run(parsed).failed == 0


@pytest.mark.parametrize("page", ["README.md", "../../README.md"])
def test_the_examples_of_the_pages_run(page, capsys):
    path = Path(__file__).parents[1] / page
    blocks = [block.split("```")[0] for block in path.read_text().split("```python\n")[1:]]
    assert blocks
    for block in blocks:
        names = {}
        exec(block, names)
        if "sim" in names:
            assert names["sim"].report["pieces"] == 2
    assert capsys.readouterr().out
