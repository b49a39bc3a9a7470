"""The Python examples of the documents run as they stand."""

import doctest
import importlib
import pkgutil
import re

import pytest
from conftest import ROOT

import sfers_rs

BLOCKS = [
    pytest.param(code, id=f"{document.name}-{at}")
    for document in (ROOT / "README.md", ROOT / "docs" / "python.md", ROOT / "python" / "README.md")
    for at, code in enumerate(re.findall(r"```python\n(.*?)```", document.read_text(), flags=re.DOTALL), start=1)
]


def test_every_document_has_one():
    assert len(BLOCKS) >= 6


@pytest.mark.parametrize("code", BLOCKS)
def test_an_example_runs(code, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    exec(compile(code, "example", "exec"), {"__name__": "example"})


@pytest.mark.parametrize("module", [m.name for m in pkgutil.walk_packages(sfers_rs.__path__, "sfers_rs.") if not m.name.endswith(("_native", "__main__"))])
def test_the_examples_in_docstrings_are_right(module):
    assert doctest.testmod(importlib.import_module(module), optionflags=doctest.ELLIPSIS).failed == 0
