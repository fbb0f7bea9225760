"""The request for a solve, and its results: fetched on any thread, and not written anywhere yet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from . import features, layers, overlay, strain
from .carriers import Moved
from .features import Features
from .prepared import Prepared
from .result_image import Layout, layout_of, redirection

# The least share of rigid texels in triangles that are rigid as a whole at which a UV map keeps features round: about
# four triangles across a feature.
LEAST_WHOLE = 0.4
# The shares of the texture above which it is asked if the skin was taken for the features, and this is said.
MUCH_RIGID, MOST_RIGID = 0.6, 0.9
IS_SKIN = "Is it the skin, which is to give way? Then press Invert, or From Texture again, in Rigidity Map"


@dataclass
class Request:
    """A pose to be solved."""

    positions: np.ndarray  # (vertices, 3) float32
    options: dict[str, Any]
    stamp: bytes  # of all that the result depends on
    # The parts of the result to be fetched; the object's name is for messages.
    name: str
    map_size: int
    write_image: bool
    write_uvs: bool
    write_strain: bool
    strain: str  # "NONE", "BEFORE" or "AFTER"
    strain_of: str  # "FEATURES", "SKIN" or "ALL"
    frame: int = 0
    # A material looks up the UV map.
    by_uv_map: bool = False
    # It is solved as a draft while the pose moves, and again when that stops.
    is_draft: bool = False


@dataclass(frozen=True)
class Outcome:
    """The parts of a solve's result that are written, None for those that were not requested, and what is told."""

    layout: Layout | None
    images: list[np.ndarray] | None  # of each layer, (height, width, 4) float32
    layers: np.ndarray | None  # (faces,) uint32; None also where there is one layer alone
    uvs: np.ndarray | None  # (corners, 2) float32
    surface: np.ndarray | None  # (vertices, 3) float32: stretch, squash, and 0
    strain: np.ndarray | None  # (vertices, 4) float32: colours
    carried: dict[int, Moved]  # by the uids of objects
    figures: list[tuple[str, str]]
    features: Features  # of the image
    notes: list[str]  # of what is likely a mistake
    questions: list[str]  # of what may be one, which does not take the tick away


def fetch(prepared: Prepared, request: Request, told: list[str]) -> Outcome:
    """Fetches the asset's last result, to the notes `told`. It may be called on any thread, while no solve is under
    way."""
    asset = prepared.asset
    layout = images = None
    if request.write_image:
        layout = layout_of(asset, request.name, request.map_size)
        images = [redirection(asset, layout, layer) for layer in range(layers.number_of(asset))]
    uvs = asset.corner_uvs() if request.write_uvs else None
    surface = colours = None
    if request.write_strain:
        surface = strain.of_surface(prepared.mesh.topology, prepared.mesh.rest, request.positions)
    if request.strain != "NONE":
        colours = overlay.colours(prepared, request.positions, request.strain == "AFTER", request.strain_of)
    carried = prepared.carriers.fetch()
    # A UV map's own are not known.
    found = Features() if request.by_uv_map else features.fetch(prepared, skin=not request.is_draft)
    shown = figures(prepared, request, uvs, found)
    told, share = told + notes(prepared, request), prepared.rigid_share()[0]
    asked = [f"{percent(share)} is rigid. {IS_SKIN}"] if MUCH_RIGID < share <= MOST_RIGID else []
    return Outcome(layout, images, prepared.layers, uvs, surface, colours, carried, shown, found, told, asked)


def figures(prepared: Prepared, request: Request, uvs: np.ndarray | None, found: Features) -> list[tuple[str, str]]:
    """Labels and values of the last solve, for the panel; the strain is for the material's source, image or UV map."""
    report = prepared.asset.report()
    tiles = [tile.report() for tile in prepared.asset.tiles]
    number = layers.number_of(prepared.asset)
    shown = [
        ("Time", f"{report.ms_total:.0f} ms"),
        ("Folds", str(report.folds)),
        ("Rigid", percent(prepared.rigid_share()[0])),
        ("Tiles", str(len({tile.udim for tile in prepared.asset.tiles}))),
    ]
    if number > 1:
        shown.append(("Layers", str(number)))
    cells = max((tile.grid_width, tile.grid_height) for tile in tiles)
    shown.append(("Grid", f"{cells[0]} x {cells[1]}"))
    if on_seams := prepared.features_on_seams():
        shown.append(("On seams", f"{on_seams} feature{'s' * (on_seams > 1)}"))
    if doubles := prepared.doubles.edges:
        shown.append(("Doubles", f"{doubles} edges, {'welded' if prepared.welded else 'cut'}"))
    edges = sum(tile.segments + tile.segments_fixed for tile in tiles)
    if edges:
        # Of all that is rigid, what cannot move too.
        fixed = sum(tile.segments_fixed * tile.strain_fixed**2 for tile in tiles)
        before, after = (
            ((sum(tile.segments * getattr(tile, side).rms ** 2 for tile in tiles) + fixed) / edges) ** 0.5
            for side in ("before", "after")
        )
        if request.by_uv_map and uvs is not None:
            after = prepared.strain_of(request.positions, uvs)
        shown.append(("Strain", f"{before:.3f} before, {after:.3f} after"))
    if found.painted:
        shown.append(("Over 0.05", f"{found.before} before, {found.after} after"))
        shown.append(("Worse", f"{found.worse} of {found.painted} features"))
    return shown + prepared.carriers.figures()


def percent(share: float) -> str:
    """A share in words that are never 0 or 100 % unless it is."""
    if 0 < share < 0.001:
        return "under 0.1 %"
    if 0.999 < share < 1:
        return "over 99.9 %"
    return f"{100 * share:.{1 if 0 < share < 0.1 or 0.9 < share < 1 else 0}f} %"


def notes(prepared: Prepared, request: Request) -> list[str]:
    """Likely mistakes in the inputs, in sentences."""
    found = _of_rigidity(*prepared.rigid_share()) or _of_overlaps(prepared)
    if request.by_uv_map and prepared.whole_share() < LEAST_WHOLE:
        found.append("Faces are larger than features, which the UV map cannot follow: press Set Up by Image")
    return found + _of_doubles(prepared, request.positions) + prepared.carriers.notes()


def _of_doubles(prepared: Prepared, pose: np.ndarray) -> list[str]:
    """A sentence if doubled vertices may be meant as one, or as the ends of a surface."""
    doubles, continues = prepared.doubles, prepared.asset.tiles[0].settings.seams == "continue"
    if prepared.welded and continues and (apart := doubles.apart(pose)):
        return [f"The mesh comes apart in this pose, at {apart} edges with doubled vertices: press Cut, below"]
    if prepared.welded or prepared.mesh.weld == "cut" or not doubles.edges:
        return []
    return [
        f"Features end at {doubles.edges} edges where vertices are double, at one place: press Weld, below, "
        "if they belong together, or Cut if not, as at lips that are closed"
    ]


def _of_overlaps(prepared: Prepared) -> list[str]:
    """A sentence if most rigid texels do not move, since islands share the texture there. All layers count."""
    tiles = prepared.asset.tiles
    rigid, overlapped = (sum(getattr(tile.info, f"rigid_{of}") for tile in tiles) for of in ("nodes", "overlapped"))
    if 2 * overlapped <= rigid or tiles[0].settings.overlap == "first_face":
        return []
    found = f"{percent(overlapped / rigid)} of what is rigid does not move, since islands share the texture there"
    if prepared.mesh.max_layers:
        return [f"{found}: there are over {layers.MOST} of them, or one lies over itself. Unwrap them side by side"]
    return [f"{found}: set Overlaps, in Quality and Outputs, to Each"]


def _of_rigidity(share: float, least: float, most: float) -> list[str]:
    # Half a step of 8 bits.
    if most < 0.5 / 255:
        ways = "paint white on it, press From Texture or From Geometry, or choose another image, channel or group"
        return [f"Nothing is rigid: the map is 0 everywhere; {ways}"]
    if least > 1 - 0.5 / 255:
        return ["All is rigid: the map is 1 everywhere, so that nothing can give way. Paint black between features"]
    if share == 0:
        return [f"The map is {most:.2f} at most: what is to keep its shape as well as it can is 1, white"]
    if share == 1:
        return [f"The map is {least:.2f} at least: what is to give way is 0, black"]
    if share > MOST_RIGID:
        return [f"{percent(share)} is rigid, so that next to nothing can give way. {IS_SKIN}"]
    return []
