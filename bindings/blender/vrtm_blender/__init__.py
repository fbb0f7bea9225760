"""vrtm in Blender: painted features keep their shape while the surface under them deforms."""

from __future__ import annotations

import importlib
import sys

NAMES = (
    "messages",
    "session",
    "tap",
    "geometry",
    "packed",
    "layers",
    "maps",
    "strain",
    "overlay",
    "prepared",
    "results",
    "work",
    "solve",
    "live",
    "properties",
    "nodes",
    "materials",
    "textures",
    "dilate",
    "keep",
    "exr",
    "reads",
    "bake",
    "status",
    "operators.base",
    "operators.solve",
    "operators.material",
    "operators.bake",
    "operators.rigidity",
    "operators.objects",
    "operators",
    "panel",
    "handlers",
)
# In the order in which they are registered; unregistering goes backwards.
REGISTERED = ("properties", "operators", "panel", "handlers")


def register() -> None:
    # After Reload Scripts Blender has loaded this file again, but not those beside it.
    loaded = {name for name in NAMES if f"{__name__}.{name}" in sys.modules}
    for name in NAMES:
        module = importlib.import_module(f"{__name__}.{name}")
        if name in loaded:
            importlib.reload(module)
    for name in REGISTERED:
        sys.modules[f"{__name__}.{name}"].register()


def unregister() -> None:
    for name in reversed(REGISTERED):
        sys.modules[f"{__name__}.{name}"].unregister()
