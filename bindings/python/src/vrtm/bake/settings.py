"""What a bake is asked to do."""

from __future__ import annotations

from dataclasses import dataclass, field

from vrtm.bake.scene import SceneOptions


@dataclass(frozen=True)
class Settings:
    """The command line of `vrtm bake`, checked. Picklable: worker processes get a copy. The options' help says what
    each is for."""

    scene: str
    options: SceneOptions = field(default_factory=SceneOptions)
    rigidity: str | None = None
    mask: str | None = None
    out: str = "out"
    name: str | None = None
    frames: tuple[int, ...] | None = None
    tiles: tuple[int, ...] | None = None
    size: int | None = None
    map_size: int | None = None
    form: str = "tile"
    half: bool = False
    alpha: bool = False
    exact: bool = False
    warp: bool = False
    jacobian: bool = False
    filter_scale: bool = False
    textures: tuple[str, ...] = ()
    normal_maps: tuple[str, ...] = ()
    normal_y: str = "up"
    layer: str | None = None
    layer_mode: str = "texture"
    only_layer: bool = False
    quality: str = "normal"
    seams: str = "shut"
    seam_reach: float = 0.0
    open_borders: str = "fixed"
    weld: str = "index"
    device: str = "auto"
    adapter: int = 0
    jobs: int = 0
    threads: int = 0
    report: str | None = None
    force: bool = False
    overwrite: bool = False
    strict: bool = False
    measure: bool = False
    max_strain: float | None = None
    max_error: float | None = None
    texture_size: int = 4096

    @property
    def corner_uvs(self) -> bool:
        """Whether the corner UVs of each frame are written, for the layer."""
        return bool(self.layer) and self.layer_mode in ("primvar", "both")
