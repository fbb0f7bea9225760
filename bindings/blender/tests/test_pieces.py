"""Connected parts of detail meshes, each carried as one body, also where a stud is near two sheets of skin, as at
lips."""

import numpy as np

from support import Case, add_mesh, asset_of, bending, bpy, displace, each, evaluated, part, quads, read, select
from test_carry import drawn, to_world, world

SIDE, SIZE = 12, 64
# Half of the slit between the lips.
GAP = 0.02


class Lips:
    """Two sheets of skin in one plane, with a slit between them along x, that go apart and turn by a shape key at frame
    5. `disc`: the radius of a rigid disc around the middle of the upper one's edge."""

    def __init__(self, disc=0.0):
        x, y = (values.ravel() for values in np.meshgrid(np.linspace(-1, 1, SIDE + 1), np.linspace(GAP, 1, SIDE + 1)))
        upper, lower = np.stack([x, y, 0 * x], -1), np.stack([x, -y, 0 * x], -1)
        moved = np.stack([1.3 * x, y + 0.3 + 0.1 * x, 0.4 * y], -1), np.stack([x, -y - 0.4, 0.1 * x - 0.2 * y], -1)
        self.rest = np.concatenate([upper, lower]).astype(np.float32)
        self.faces = np.concatenate([quads(SIDE), quads(SIDE)[:, ::-1] + len(x)])
        plane = np.stack([0.5 + 0.45 * x, 0.04 + 0.44 * (y - GAP)], -1)
        self.uvs = np.concatenate([plane, plane + np.array([0, 0.5])])[self.faces].reshape(-1, 2).astype(np.float32)
        self.pose = np.concatenate(moved).astype(np.float32)
        at = (np.arange(SIZE) + 0.5) / SIZE
        u, v = np.meshgrid(at, at)
        self.rigidity = (np.hypot(u - 0.5, v - 0.04) < 0.45 * disc).astype(np.float32)
        obj = self.object = bending("lips", self.rest, self.faces, self.uvs, self.pose, self.rigidity)
        displace(obj)


def stud(centre, radius=0.1, height=0.08, sides=10):
    """A frustum's vertices and faces; its foot is in the plane of the lips."""
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], -1)
    points = np.concatenate([radius * ring, 0.8 * radius * ring + np.array([0, 0, height])]) + np.array([*centre, 0])
    following = np.roll(np.arange(sides), -1)
    walls = np.stack([np.arange(sides), following, following + sides, np.arange(sides) + sides], -1)
    return points, walls


class Pieces(Case):
    # The first and the third one stand across the slit, mostly on the upper and on the lower lip.
    CENTRES = ((0.0, GAP + 0.015), (0.5, -0.5), (-0.6, -GAP - 0.015), (0.4, 0.6))

    def detail(self, lips):
        """The studs as one mesh, and its points in the skin's space."""
        made = [stud(centre) for centre in self.CENTRES]
        points = np.concatenate([points for points, _ in made])
        faces = np.concatenate([faces + 20 * k for k, (_, faces) in enumerate(made)])
        return add_mesh("studs", to_world(lips.object, points), faces), points

    def wrapped(self, lips, obj, **settings):
        """The points in the skin's space at frame 5."""
        bpy.context.scene.frame_set(1)
        select(obj, lips.object)
        self.assertEqual(bpy.ops.vrtm.wrap(farthest=0.5, **settings), {"FINISHED"})
        self.update(5)
        skin = world(lips.object)
        return (drawn(obj) - skin[:3, 3]) @ np.linalg.inv(skin[:3, :3]).T

    @staticmethod
    def lengths(obj, points):
        edges = read(obj.data.edges, "vertices", 2, np.int32)
        return np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)

    def expected(self, lips, feet):
        """By the Python package alone."""
        asset = asset_of(lips.rest, lips.faces, lips.uvs, SIZE, {1001: lips.rigidity})
        carrier = asset.carrier(positions=feet)
        asset.solve(lips.pose)
        return carrier.fetch("positions", "matrices", dtype=np.float64)

    @each("disc", (0.0, 0.25))
    def test_a_stud_across_a_slit_stays_whole(self, disc):
        lips = Lips(disc)
        obj, points = self.detail(lips)
        before = self.lengths(obj, points)
        torn = self.lengths(obj, self.wrapped(lips, obj)) / before
        self.assertGreater(torn.max(), 3)
        posed = self.wrapped(lips, obj, pieces=True)
        np.testing.assert_allclose(self.lengths(obj, posed), before, rtol=1e-5)
        # Each as a body of its own, by its foot.
        feet = np.array([(*centre, 0) for centre in self.CENTRES])
        found = self.expected(lips, feet)
        offsets = points.reshape(len(feet), -1, 3) - feet[:, None]
        where = found.positions[:, None] + np.einsum("nij,nkj->nki", found.matrices, offsets)
        np.testing.assert_allclose(posed, where.reshape(-1, 3), atol=1e-5)
        # Those across the slit go with one lip each.
        self.assertGreater(posed[:20, 1].min(), 0.15)
        self.assertLess(posed[40:60, 1].max(), -0.15)

    def test_the_choice_is_saved_with_what_is_carried(self):
        lips = Lips(disc=0.25)
        obj, _ = self.detail(lips)
        # A skirt has no effect.
        posed = self.wrapped(lips, obj, pieces=True, skirt=0.2)
        self.assertSame(posed, self.wrapped(lips, obj, pieces=True))
        # Other edges are other parts: now the first two move as one.
        obj.data.edges.add(1)
        obj.data.edges[-1].vertices = (0, 20)
        lengths = self.lengths(obj, np.zeros((80, 3)))
        self.assertEqual(len(lengths), 4 * 30 + 1)
        self.update()
        own, joined = (part("geometry").positions(of.data) for of in (obj, evaluated(obj)))
        for one, other, same in ((0, 20, True), (0, 40, False), (20, 60, False)):
            apart, rest = (np.linalg.norm(of[one] - of[other]) for of in (joined, own))
            self.assertEqual(abs(apart / rest - 1) < 1e-5, same)
