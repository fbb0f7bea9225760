"""The options of geometry on the skin."""

from __future__ import annotations

import argparse

from vrtm.bake.parsing import positive, several
from vrtm.bake.settings import CONNECTED


def add(group: argparse._ArgumentGroup) -> None:
    """Adds them."""
    several(
        group,
        "--carry-prims",
        "PATH",
        "instances, points, curves and detail meshes that ride on the redirected surface: these prims and all below "
        "them, of a USD or Alembic scene; in --out, carried.usdc, a layer over them, or carried.abc, an archive, has "
        "them in all frames",
    )
    group.add_argument(
        "--carry",
        metavar="FILE",
        help="with --carry-prims: the USD or Alembic file that has them, at rest, in the same world (the scene)",
    )
    group.add_argument(
        "--carry-farthest",
        type=positive,
        metavar="X",
        help="the largest distance from the mesh at rest, in its units; what is farther stays where it is (5 %% of the "
        "diagonal of the mesh's bounding box)",
    )
    group.add_argument(
        "--carry-fit",
        choices=("feature", "surface", "none"),
        default="feature",
        help="rigid features carry what is on them as one body (feature, the default); all follows the redirected "
        "surface (surface); or the skin, as if nothing were redirected (none)",
    )
    group.add_argument(
        "--carry-pieces",
        choices=("none", CONNECTED),
        default="none",
        help="connected: each connected part of a detail mesh is one rigid body, bound where it is nearest to the "
        "surface; by default (none) each point of it is bound by itself",
    )


def wrong(a: argparse.Namespace) -> dict[str, object]:
    """What may be wrong with them, each with whether it is."""
    given = {
        "--carry": a.carry is not None,
        "--carry-farthest": a.carry_farthest is not None,
        "--carry-fit": a.carry_fit != "feature",
        "--carry-pieces": a.carry_pieces != "none",
    }
    against = {"--only-layer": a.only_layer, "--subsets": a.subsets, "--tiles": a.tiles is not None}
    return {
        **{f"{option} needs --carry-prims": there and not a.carry_prims for option, there in given.items()},
        **{
            f"--carry-prims and {option} exclude each other": a.carry_prims and there
            for option, there in against.items()
        },
    }
