#!/usr/bin/env python3
"""Prints a document for a registry, which shows it away from its folder: relative links lead into the repository at the
version's tag, or, where there is no address, are their text alone.

    VRTM_REPOSITORY=https://... python3 bindings/links.py bindings/web/README.md
"""

import os
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LINK = re.compile(r"(!?)\[([^][]*)\]\(\s*([^()\s]+)\s*\)")


def absolute(file: Path, version: str) -> str:
    """The text of `file`; VRTM_REPOSITORY is the address of the repository."""
    repository = os.environ.get("VRTM_REPOSITORY", "").rstrip("/")

    def replaced(match: re.Match) -> str:
        image, text, target = match.groups()
        if re.match(r"[a-z]+:", target):
            return match[0]
        if not repository:
            return "" if image else text
        path, hash, anchor = target.partition("#")
        place = (file.parent / path if path else file).resolve().relative_to(ROOT).as_posix()
        return f"{image}[{text}]({repository}/{'raw' if image else 'blob'}/v{version}/{place}{hash}{anchor})"

    return LINK.sub(replaced, file.read_text("utf-8"))


if __name__ == "__main__":
    cargo = (ROOT / "Cargo.toml").read_text("utf-8")
    print(absolute(Path(sys.argv[1]).resolve(), re.search(r'^version = "(.*)"', cargo, re.M)[1]), end="")
