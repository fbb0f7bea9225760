"""The figures of docs/paper.md at small sizes: benches/paper/quick.py."""

import sys

from checks import ASSETS, REPOSITORY, check, run, skip

sys.path.append(str(REPOSITORY / "benches" / "paper"))
import quick


def paper():
    for name, held, figures in quick.checks(ASSETS):
        if held is None:
            skip(f"paper: {name}", figures)
        else:
            check(f"paper: {name}", held, figures)


run(paper)
