"""The operators of buttons and menus."""

from __future__ import annotations

import bpy

from . import bake, carry, from_picture, material, objects, rigidity, solve

register, unregister_classes = bpy.utils.register_classes_factory(
    [cls for part in (solve, objects, rigidity, from_picture, material, bake, carry) for cls in part.CLASSES]
)


def unregister() -> None:
    unregister_classes()
    from_picture.previews.close()
