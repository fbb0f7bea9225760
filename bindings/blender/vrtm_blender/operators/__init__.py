"""The operators of buttons and menus."""

from __future__ import annotations

import bpy

from . import bake, carry, material, objects, rigidity, solve

CLASSES = (
    *solve.CLASSES,
    *objects.CLASSES,
    *rigidity.CLASSES,
    *material.CLASSES,
    *bake.CLASSES,
    *carry.CLASSES,
)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
