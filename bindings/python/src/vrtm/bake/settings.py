"""The settings of a bake."""

import os
from dataclasses import dataclass, field, fields, replace

import vrtm
from vrtm.bake.frames import Frame
from vrtm.bake.scene import SceneOptions

EACH = "each"
"""Charts that lie over one another are baked each by itself, in layers."""
OVERLAP = EACH
"""The default."""
AUTO = "auto"
"""A size of maps that follows from what they hold; what happens at borders, chosen for each mesh."""
CONNECTED = "connected"
"""Each connected part of a carried mesh is one rigid body."""
NUMBERS = tuple(f.name for f in fields(vrtm.TileSettings) if f.type == "float" and f.name != "seam_reach")
"""The numbers among the library's settings of a tile, by its names."""


def is_alembic(path: str) -> bool:
    return path.lower().endswith(".abc")


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
    frames: tuple[Frame, ...] | None = None
    tiles: tuple[int, ...] | None = None
    task: tuple[int, int] | None = None
    """The number of a farm's task, from 1, and their count."""
    size: int | None = None
    map_size: int | str | None = None
    """`auto`: see `AUTO`."""
    form: str = "tile"
    half: bool = False
    alpha: bool = False
    warp: bool = False
    jacobian: bool = False
    filter_scale: bool = False
    textures: tuple[str, ...] = ()
    normal_maps: tuple[str, ...] = ()
    normal_y: str = "up"
    subsets: bool = False
    layer: str | None = None
    layer_mode: str = "texture"
    only_layer: bool = False
    root: str | None = None
    freeze: Frame | None = None
    quality: vrtm.Quality = "normal"
    scale: vrtm.Scale = "keep"
    warm: bool = False
    temporal_weight: float = 0.0
    seams: str = AUTO
    seam_reach: float = vrtm.TileSettings().seam_reach
    open_borders: str = AUTO
    overlap: str = OVERLAP
    max_layers: int = 32
    numbers: dict[str, float] = field(default_factory=dict)
    """The given ones of `NUMBERS`."""
    weld: vrtm.Weld = "index"
    device: vrtm.Backend = "auto"
    adapter: int = 0
    jobs: int = 0
    threads: int = 0
    report: str | None = None
    overwrite: bool = False
    strict: bool = False
    check: bool = True
    allow_units: bool = False
    dry_run: bool = False
    log: str | None = None
    verbose: bool = False
    measure: bool = False
    sheet: bool = False
    max_strain: float | None = None
    max_error: float | None = None
    max_worse: int | None = None
    basis: bool = False
    basis_format: str = "half"
    gltf: bool = False
    blend_shapes: bool = False
    controls: str | None = None
    held_out: tuple[Frame, ...] | None = None
    texture_size: int = 4096
    carry: str | None = None
    carry_prims: tuple[str, ...] = ()
    carry_farthest: float | None = None
    carry_fit: vrtm.Fit = "feature"
    carry_pieces: str = "none"

    @property
    def tile_settings(self) -> dict[str, object]:
        """The library's settings of a tile, as far as they are given or, those of borders, chosen."""
        borders = {name: getattr(self, name) for name in ("seams", "seam_reach", "open_borders")}
        # Layers do not overlap, and what is left of overlaps in them does not move.
        return self.numbers | borders | {"overlap": "first_face" if self.overlap == "first" else "fixed"}

    @property
    def bound(self) -> float:
        """Largest error of maps that are as small or as few as possible, in UV."""
        return (1.0 if self.max_error is None else self.max_error) / self.texture_size

    @property
    def limits(self) -> dict[str, float]:
        """Limits of a bake, by their options."""
        given = {"--max-strain": self.max_strain, "--max-error": self.max_error, "--max-worse": self.max_worse}
        return {option: limit for option, limit in given.items() if limit is not None}

    @property
    def layers(self) -> int:
        """The most layers that a tile may have; 0 if there are none."""
        return self.max_layers if self.overlap == EACH else 0

    @property
    def beside(self) -> dict[str, str]:
        """The files besides those below `out`, by their options."""
        files = {"--layer": None if self.task else self.layer or None, "--root": self.root, "--report": self.report}
        return {option: path for option, path in files.items() if path is not None}

    @property
    def carry_file(self) -> str | None:
        """The layer or archive with what is carried."""
        kind = "abc" if is_alembic(self.carry or self.scene) else "usdc"
        return os.path.join(self.out, f"carried.{kind}") if self.carry_prims else None

    @property
    def is_unpainted(self) -> bool:
        """True if nothing says yet what is rigid, and so nothing can be baked."""
        return self.rigidity is None and self.options.rigidity_primvar is None

    @property
    def corner_uvs(self) -> bool:
        """True if the corner UVs of each frame are written, for the layer."""
        return bool(self.layer) and self.layer_mode == "primvar"


@dataclass(frozen=True)
class Borders:
    """The treatment of the borders of a mesh's charts."""

    seams: str
    open_borders: str
    why: str = ""
    """The reason for the choice; empty if the command line makes it."""

    def of(self, settings: Settings) -> Settings:
        return replace(settings, seams=self.seams, open_borders=self.open_borders)
