"""`vrtm bake --basis` with --gltf, which is evaluated here, and --blend-shapes, whose file UsdSkel evaluates: against
the library's own corner UVs."""

import json
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, UsdSkel

import test_bake_basis
from bake_scenes import solved_alone
from conftest import REPOSITORY
from test_bake_basis import BOUND, SIZE, document, gentle
from vrtm.bake.scene import Scene, Shape
from vrtm.basis.gltf import read


class Glb:
    """A binary glTF; Khronos' validator looks at the file itself."""

    def __init__(self, path: Path) -> None:
        self.json, self.accessor = read(path.read_bytes())

    def posed(self, primitive: dict, weights: np.ndarray) -> dict[str, np.ndarray]:
        """Positions and UVs with v down, with these weights."""
        found = {name: self.accessor(number) for name, number in primitive["attributes"].items()}
        for weight, target in zip(weights, primitive["targets"], strict=True):
            for name, number in target.items():
                found[name] = found[name] + float(weight) * self.accessor(number)
        return found

    def animation(self) -> tuple[np.ndarray, np.ndarray]:
        """Times, and weights (frames, targets)."""
        (animation,) = self.json["animations"]
        (channel,), (sampler,) = animation["channels"], animation["samplers"]
        assert channel == {"sampler": 0, "target": {"node": 0, "path": "weights"}}
        times = self.accessor(sampler["input"]).ravel()
        return times, self.accessor(sampler["output"]).reshape(len(times), -1)


def bake(folder: Path, *more: object) -> None:
    test_bake_basis.bake(folder, "--max-error", BOUND, *more, expect=None)


def posed(folder: Path) -> tuple[Shape, Iterator[tuple[float, np.ndarray, np.ndarray]]]:
    """The mesh, and of each frame its number, positions, and corner UVs of the library."""
    scene = folder / "scene" / "sheet.usda"
    with Scene(str(scene)) as file:
        (shape,) = file.shapes
        poses = [(frame, file.positions(shape, frame)) for frame in file.frames]
    return shape, ((frame, pose, solved_alone(scene, frame, 32).corner_uvs()) for frame, pose in poses)


@pytest.fixture(scope="module")
def baked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("gltf")
    gentle(folder, 4)
    bake(folder, "--gltf")
    return folder


def largest(folder: Path, glb: Glb) -> tuple[float, float]:
    """The largest errors of UVs, in texels, and of positions, in units, at the corners of the mesh in all frames."""
    _, weights = glb.animation()
    shape, poses = posed(folder)
    of_uvs, of_positions = 0.0, 0.0
    for row, (_, pose, wanted) in zip(weights, poses):
        found = {}
        for primitive in glb.json["meshes"][0]["primitives"]:
            udim = int(glb.json["materials"][primitive["material"]]["name"])
            rest = glb.posed(primitive, np.zeros(len(row)))
            now = glb.posed(primitive, row)
            for vertex in np.unique(glb.accessor(primitive["indices"]).astype(int)):
                u, v = rest["TEXCOORD_0"][vertex]
                key = tuple(np.round([*rest["POSITION"][vertex], u + udim - 1001, 1 - v], 5))
                x, y = now["TEXCOORD_0"][vertex]
                found[key] = (x + udim - 1001, 1 - y), now["POSITION"][vertex]
        keys = np.hstack([shape.rest[shape.indices], shape.uvs[shape.uv_indices]]).astype(float).round(5)
        for corner, vertex in enumerate(shape.indices):
            uv, position = found[tuple(keys[corner])]
            of_uvs = max(of_uvs, SIZE * float(np.hypot(*(np.array(uv) - wanted[corner]))))
            of_positions = max(of_positions, float(np.linalg.norm(position - pose[vertex])))
    return of_uvs, of_positions


def test_weights_drive_positions_and_uvs_together(baked: Path) -> None:
    glb, told = Glb(baked / "out" / "basis.glb"), document(baked)["gltf"]
    times, weights = glb.animation()
    np.testing.assert_allclose(times, np.arange(4) / 24)
    assert weights.shape[1] == len(told["targets"]) == len(glb.json["meshes"][0]["weights"])
    # Programs differ in what they make of a target without positions: all have both.
    for primitive in glb.json["meshes"][0]["primitives"]:
        assert all(set(target) == {"POSITION", "TEXCOORD_0"} for target in primitive["targets"])
    assert glb.json["meshes"][0]["extras"]["targetNames"] == told["targets"]
    uvs, positions = largest(baked, glb)
    # The corners of the mesh are some of the vertices that the error is the largest of.
    assert uvs <= told["error"] + 0.01 and told["error"] <= 1.5 * BOUND
    assert positions <= 5e-4 * 2.2, "of the size of two sheets"
    assert told["error_between"] <= SIZE * max(BOUND / SIZE, 1 / 2048) * 1.001
    assert told["triangles"] > told["mesh_triangles"]
    most = 0
    for row in weights:
        count = 0
        for primitive in glb.json["meshes"][0]["primitives"]:
            corners = glb.accessor(primitive["indices"]).astype(int).reshape(-1, 3)
            signs = []
            for own in (np.zeros(len(row)), row):
                uvs = glb.posed(primitive, own)["TEXCOORD_0"][corners]
                signs.append(np.sign(np.linalg.det(uvs[:, 1:] - uvs[:, :1])))
            count += int((signs[0] * signs[1] < 0).sum())
        most = max(most, count)
    assert most == told["folds"] == 0


def test_controls_are_targets_of_their_own_names(tmp_path: Path) -> None:
    """Frame 1 is one shape, 2 another, and 3 both: bilinear, and exact at these poses."""
    gentle(tmp_path, 3)
    (tmp_path / "controls.csv").write_text("frame,pull,bend\n1,0.5,0\n2,0,1\n3,1,1\n")
    bake(tmp_path, "--gltf", "--controls", tmp_path / "controls.csv")
    glb, told = Glb(tmp_path / "out" / "basis.glb"), document(tmp_path)
    assert told["driver"]["form"] == "products" and told["gltf"]["targets"] == ["pull", "bend", "pull*bend"]
    np.testing.assert_allclose(glb.animation()[1], [[0.5, 0, 0], [0, 1, 0], [1, 1, 1]])
    uvs, positions = largest(tmp_path, glb)
    # In f32, and of UVs of 2: some 1e-7 of each.
    assert uvs < 0.01 and positions < 1e-5


def test_khronos_validator_finds_no_error(baked: Path) -> None:
    """Runs where Node has the package `gltf-validator`, in NODE_PATH."""
    script = (
        "require('gltf-validator').validateBytes(new Uint8Array(require('fs').readFileSync(process.argv[1])))"
        ".then(r => console.log(JSON.stringify(r.issues)))"
    )
    node = shutil.which("node")
    if node is None or subprocess.run([node, "-e", "require('gltf-validator')"], capture_output=True).returncode:
        pytest.skip("skipped: no gltf-validator")
    ended = subprocess.check_output([node, "-e", script, str(baked / "out" / "basis.glb")])
    issues = json.loads(ended)
    assert issues["numErrors"] == 0 and issues["numWarnings"] == 0, issues


def test_usd_evaluates_what_the_frames_have(tmp_path: Path) -> None:
    """By the page's own way to take UVs from points, at each corner of the scene's mesh."""
    gentle(tmp_path, 3)
    (tmp_path / "controls.csv").write_text("frame,pull,left-arm\n1,1,0\n2,0,1\n3,1,1\n")
    bake(tmp_path, "--blend-shapes", "--controls", tmp_path / "controls.csv")
    told = document(tmp_path)["blend_shapes"]
    # In memory, so that what is changed stays out of the layer that others may open.
    stage = Usd.Stage.Open(Sdf.Layer.OpenAsAnonymous(str(tmp_path / "out" / "basis.usdc")))
    root = stage.GetDefaultPrim()
    motion = UsdSkel.Animation(root.GetChild("motion"))
    assert list(motion.GetBlendShapesAttr().Get())[:3] == ["pull", "left_arm", "pull_left_arm"]
    mesh, of_uvs = (UsdGeom.Mesh(root.GetChild(name)) for name in ("mesh", "uvs"))
    assert of_uvs.ComputePurpose() == "guide" and mesh.ComputePurpose() == "default"
    page = (REPOSITORY / "docs" / "games.md").read_text()
    exec(re.findall(r"```python\n(.*?)```", page, re.DOTALL)[0], {"stage": stage})
    st = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st")
    shape, poses = posed(tmp_path)
    for frame, pose, wanted in poses:
        points, uvs = np.array(mesh.GetPointsAttr().Get(frame)), np.array(st.Get(frame))
        most = 0.0
        for corner, vertex in enumerate(shape.indices):
            # Among the vertices in its place the one with the nearest UV: the tiles' borders are in one place.
            there = np.linalg.norm(points - pose[vertex], axis=1) < 1e-3 * np.ptp(shape.rest, axis=0).max()
            most = max(most, SIZE * float(np.linalg.norm(uvs[there] - wanted[corner], axis=1).min()))
        assert most <= told["error"] + 1e-3 and most <= BOUND and told["folds"] == 0
