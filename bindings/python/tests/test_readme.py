"""The README's examples run as they stand there."""

import re
from pathlib import Path

README = Path(__file__).resolve().parents[1] / "README.md"


def test_examples(capsys):
    blocks = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.S)
    assert len(blocks) == 2
    names: dict = {}
    for block in blocks:
        exec(compile(block, str(README), "exec"), names)
    # The squashed feature is looked up elsewhere than at its own UV, and the map does not fold.
    (u, _v), jacobian = names["redirection"][32, 16], float(capsys.readouterr().out.split()[-1])
    assert abs(u - 16.5 / 64) > 0.005 and jacobian > 0
    assert names["report"].tiles == 1
