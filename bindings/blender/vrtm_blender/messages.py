"""Messages to artists: problems as sentences, and the status bar."""

from __future__ import annotations

import re

import bpy


class Problem(Exception):
    """A fault that the artist can mend; its text names the object or the setting, and the remedy."""


def text_of(error: BaseException) -> str:
    """One line about an exception: a problem's or the library's own words, and the type's name for all others."""
    line = " ".join(str(error).split()) or "no message"
    if isinstance(error, Problem):
        return line
    # The library's errors carry a status; their messages name a function, which is not the artist's, and the argument.
    if hasattr(error, "status_name"):
        return re.sub(r"^vrtm_\w+: ", "", line)
    return f"{type(error).__name__}: {line}"


# True while the status bar shows a line of this add-on.
_shown = False


def status(text: str | None) -> None:
    """Shows a line in the status bar of every window; None gives the bar back to Blender, if a line is shown."""
    global _shown
    if bpy.app.background or (text is None and not _shown):
        return
    _shown = text is not None
    for window in bpy.context.window_manager.windows:
        window.workspace.status_text_set(text)
