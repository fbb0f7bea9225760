"""The job templates for render farms."""

import re
from importlib import resources


def template(layer: bool = True, carry: bool = False) -> str:
    """The template of OpenJobDescription, as YAML. `layer`: adds a last step that writes a USD layer, which scenes of
    other formats do not need. `carry`: adds steps that move geometry on the surface."""
    text = _read("vrtm-bake.yaml")
    for name, kept in (("layer", layer), ("carry", carry)):
        text = _block(name).sub(r"\1" if kept else "", text)
    # All steps run the same command, and each adds options.
    run = _block("run").search(text)
    assert run is not None
    return text.replace("    # run\n", run[1]).replace(run[0], run[1])


def slurm() -> str:
    """The script that submits a bake to Slurm."""
    return _read("vrtm-bake.sh")


def _read(name: str) -> str:
    return (resources.files(__name__) / name).read_text(encoding="utf-8")


def _block(name: str) -> re.Pattern[str]:
    """The lines between two comments."""
    return re.compile(rf"^ *# begin {name}\n(.*?)^ *# end {name}\n", re.DOTALL | re.MULTILINE)
