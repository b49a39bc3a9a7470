"""Runs unmodified code for PyBullet on the drop-in: `python -m sfers_rs.pybullet script.py ...`, `-m module ...`, `-c code ...` or `-`."""

import os
import runpy
import sys

from sfers_rs import pybullet

USAGE = "usage: python -m sfers_rs.pybullet (SCRIPT | -m MODULE | -c CODE | -) [ARGUMENT ...]"


def run_text(code: str, name: str) -> None:
    """Runs code as the main module."""
    names = {"__name__": "__main__", "__builtins__": __builtins__, "__doc__": None, "__package__": None, "__spec__": None, "__loader__": None}
    sys.modules["__main__"].__dict__.update(names)
    exec(compile(code, name, "exec"), sys.modules["__main__"].__dict__)


def main() -> None:
    """Takes the drop-in's own arguments away and runs the rest as Python itself would."""
    arguments = sys.argv[1:]
    if not arguments or arguments[0] in ("-h", "--help"):
        print(USAGE)
        sys.exit(0 if arguments else 2)
    pybullet.install()
    what, rest = arguments[0], arguments[1:]
    if what == "-":
        sys.argv = ["-", *rest]
        sys.path[0] = ""
        run_text(sys.stdin.read(), "<stdin>")
    elif what in ("-m", "-c") and not rest:
        sys.exit(f"{USAGE}\nerror: {what} needs a value")
    elif what == "-c":
        sys.argv = ["-c", *rest[1:]]
        sys.path[0] = ""
        run_text(rest[0], "<string>")
    elif what == "-m":
        sys.argv = rest
        sys.path[0] = os.getcwd()
        runpy.run_module(rest[0], run_name="__main__", alter_sys=True)
    elif what.startswith("-"):
        sys.exit(f"{USAGE}\nerror: {what} is no option")
    else:
        sys.argv = [what, *rest]
        if not os.path.isdir(what):
            sys.path[0] = os.path.dirname(os.path.abspath(what))
        runpy.run_path(what, run_name="__main__")


if __name__ == "__main__":
    main()
