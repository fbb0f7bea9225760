"""The example runs, and its picture shows what it says."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np

SCRIPT = Path(__file__).resolve().parents[1] / "examples" / "figure.py"


def test_figure(tmp_path):
    out = tmp_path / "figure.png"
    done = subprocess.run([sys.executable, SCRIPT, "--out", out], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr[-500:]
    before, after = map(float, re.search(r"RMS: ([\d.]+) before, ([\d.]+) after", done.stdout).groups())
    assert before > 0.3 and after < 0.02
    from matplotlib import image

    picture = image.imread(out)[..., :3]
    assert picture.shape[1] > 3 * picture.shape[0]
    # Three panels, each partly skin; the middle one, with stretched studs, has most of the studs' light colour.
    panels = np.array_split(picture, 3, axis=1)
    skin = [(panel[..., 0] - panel[..., 2] > 0.15).mean() for panel in panels]
    light = [((panel.min(-1) > 0.35) & (panel.max(-1) < 0.95)).mean() for panel in panels]
    assert min(skin) > 0.15 and light[1] > 1.15 * light[2] > 0
