"""The bake tool: scenes in; maps, warped textures and a USD layer out. `vrtm bake` is its command."""
