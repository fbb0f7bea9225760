"""Names of the files that are written: a pattern with placeholders."""

import os
import re
from collections.abc import Mapping

from vrtm.bake.failure import INPUT, Failure
from vrtm.bake.frames import Frame, padded

ONE_MESH = "<kind>.<frame>.<UDIM>.exr"
"""The pattern of a single mesh: renderers and painting programs want the tile's number last."""
SEVERAL = "<mesh>." + ONE_MESH
"""The pattern of several meshes."""

_PLACEHOLDERS = ("<mesh>", "<subset>", "<kind>", "<frame>", "<UDIM>")


class Pattern:
    """A path below the output folder; `<mesh>`, `<subset>`, `<kind>`, `<frame>` and `<UDIM>` stand for what a file
    holds."""

    def __init__(self, text: str, counts: Mapping[str, int]) -> None:
        """`counts`: how many different values each placeholder takes, those of more than one being needed. Raises
        Failure."""
        self.text = text

        def bad(reason: str) -> Failure:
            return Failure(INPUT, f"--name {text}: {reason}")

        parts = text.split("/")
        if "\\" in text or os.path.isabs(text) or any(part in ("", ".", "..") for part in parts):
            raise bad("it must stay inside of the output folder: no '..', no '\\', no '/' at either end")
        if not parts[-1].endswith(".exr") or parts[-1] == ".exr":
            raise bad("it must end in .exr, with a name before that")
        for found in re.findall(r"<[^>]*>?|\$\{?F\d*|%\d*d|%\(\w*\)\d*d|##+|@@+", text):
            if found not in _PLACEHOLDERS:
                raise bad(f"'{found}' is none of {', '.join(_PLACEHOLDERS)}")
        if "<subset>" in text and "<subset>" not in counts:
            raise bad("<subset> needs --subsets")
        for placeholder, count in counts.items():
            if count > 1 and placeholder not in text:
                raise bad(f"{count} values of {placeholder} are written, and it must keep them apart")

    def name(
        self,
        mesh: str,
        kind: str,
        frame: Frame | str,
        udim: int | str,
        extension: str = ".exr",
        layer: int = 0,
        subset: str = "",
    ) -> str:
        """The path of a file below the output folder. Frames get at least four digits. A layer from 1 on stands behind
        the kind, `redirect_layer1`; in a pattern without kinds, before the numbers of the frame and the tile."""
        number = frame if isinstance(frame, str) else padded(frame)
        text, mark = self.text, f"_layer{layer}" if layer else ""
        if mark and "<kind>" not in text:
            # Numbers stay last, where programs look for them.
            folder, slash, name = text.rpartition("/")
            before = re.split("<frame>|<UDIM>|\\.exr$", name)[0].rstrip("._- ")
            text = f"{folder}{slash}{before}{mark if before else mark[1:] + '.'}{name[len(before) :]}"
            mark = ""
        values = {"<mesh>": mesh, "<subset>": subset, "<kind>": kind + mark, "<frame>": number, "<UDIM>": str(udim)}
        filled = re.sub("|".join(_PLACEHOLDERS), lambda match: values[match[0]], text)
        return filled[: -len(".exr")] + extension
