"""vrtm in Blender: painted features keep their shape while the surface under them deforms."""

from __future__ import annotations

import importlib
import sys

# In the order in which they are registered; unregistering goes backwards.
REGISTERED = ("properties", "carry", "operators", "panel", "handlers")


def register() -> None:
    # After Reload Scripts Blender has loaded this file again, but not those beside it.
    for name in [name for name in sys.modules if name.startswith(f"{__name__}.")]:
        del sys.modules[name]
        globals().pop(name.removeprefix(f"{__name__}."), None)
    for name in REGISTERED:
        importlib.import_module(f"{__name__}.{name}").register()


def unregister() -> None:
    for name in reversed(REGISTERED):
        sys.modules[f"{__name__}.{name}"].unregister()
