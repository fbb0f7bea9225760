"""The job template for render farms that run OpenJobDescription."""

import re
from importlib import resources

_NAME = "vrtm-bake.yaml"
_LAYER = re.compile(r"^ *# begin layer\n(.*?)^ *# end layer\n", re.DOTALL | re.MULTILINE)


def template(layer: bool = True) -> str:
    """The template as YAML. `layer`: adds a last step that writes a USD layer, which scenes of other formats do not
    need."""
    text = resources.files(__name__).joinpath(_NAME).read_text(encoding="utf-8")
    return _LAYER.sub(r"\1" if layer else "", text)
