"""Writes the licences of all that the wheel holds: python scripts/licences.py OUT.

The texts of every crate that `sfers-python` is linked with, as they lie in cargo's registry, and Debian's statement on Bullet. A crate without a text is an error
unless one of its licences is among those that another crate's text gives.
"""

import json
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

BULLET = Path("/usr/share/doc/libbullet3.24/copyright")
TARGET = "x86_64-unknown-linux-gnu"


def linked() -> list[dict]:
    """The packages that the wheel's library is linked with, without this project's own."""
    command = ["cargo", "metadata", "--format-version", "1", "--locked", "--filter-platform", TARGET]
    metadata = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    packages = {package["id"]: package for package in metadata["packages"]}
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    todo = [id for id, package in packages.items() if package["name"] == "sfers-python"]
    found: dict[str, dict] = {}
    while todo:
        for dependency in nodes[todo.pop()]["deps"]:
            is_linked = any(kind["kind"] is None for kind in dependency["dep_kinds"])
            if is_linked and dependency["pkg"] not in found:
                found[dependency["pkg"]] = packages[dependency["pkg"]]
                todo.append(dependency["pkg"])
    return [package for package in found.values() if package["source"]]


def main() -> None:
    out = Path(sys.argv[1])
    texts, without = defaultdict(list), []
    for package in sorted(linked(), key=lambda package: package["name"]):
        name = f"{package['name']} {package['version']} ({package['license']})"
        folder = Path(package["manifest_path"]).parent
        files = [path for path in sorted(folder.iterdir()) if path.is_file() and path.name.upper().startswith(("LICENSE", "LICENCE", "COPYING", "NOTICE", "UNLICENSE"))]
        for path in files:
            texts[path.read_text(encoding="utf-8", errors="replace").strip()].append(name)
        if not files:
            without.append(name)
    parts = ["The library in this wheel is linked with these Rust crates. Each text stands below the crates that come with it.\n"]
    parts += [f"{'=' * 100}\n{chr(10).join(names)}\n{'-' * 100}\n{text}\n" for text, names in sorted(texts.items(), key=lambda item: item[1])]
    if without:
        parts.append(f"{'=' * 100}\nWithout a text of their own, under the licences named:\n{chr(10).join(without)}\n")
    out.mkdir(parents=True, exist_ok=True)
    (out / "RUST-CRATES.txt").write_text("\n".join(parts), encoding="utf-8")
    (out / "BULLET.txt").write_text(BULLET.read_text(encoding="utf-8"), encoding="utf-8")
    print(f"{sum(map(len, texts.values()))} texts of crates, {len(without)} crates without one")


if __name__ == "__main__":
    main()
