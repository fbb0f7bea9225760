"""What buttons and menus do."""

from __future__ import annotations

import bpy

from . import bake, basis, carry, material, objects, rigidity, solve

CLASSES = (
    *solve.CLASSES,
    *objects.CLASSES,
    *rigidity.CLASSES,
    *material.CLASSES,
    *bake.CLASSES,
    *basis.CLASSES,
    *carry.CLASSES,
)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
