"""OBJ files: a mesh at rest, and a file for each pose."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from conftest import REPOSITORY, refused
from vrtm.bake.scene import Scene, SceneError, SceneOptions

VERTICES = "v 0 0 0\nv 1 0 0\nv 2 0 0\nv 0 1 0\nv 1 1 0\nv 2 1 0\n"
UVS = "vt 0 0\nvt 0.5 0\nvt 1 0\nvt 0 1\nvt 0.5 1\nvt 1 1\n"
FACES = "f 1/1 2/2 5/5 4/4\nf 2/2/1 3/3/1 6/6/1 5/5/1\n"


def write(path: Path, text: str) -> str:
    path.write_text(text)
    return str(path)


def pose(path: Path, width: float, faces: str = FACES) -> str:
    return write(path, VERTICES.replace("v 2 ", f"v {width} ") + UVS + faces)


def test_vertices_uvs_and_polygons_keep_their_order(tmp_path: Path) -> None:
    head, more = "# made by hand\r\nmtllib none.mtl\no part\n", "g more\nf -6 -4 -2 # end\nf 1//3 2// 5/\n"
    text = f"{head}{VERTICES}{UVS}vn 0 0 1\ns 1\nusemtl a\n{FACES}{more}"
    scene = Scene(write(tmp_path / "my mesh.obj", text))
    (shape,) = scene.shapes
    assert shape.name == "my_mesh" and shape.face_counts.tolist() == [4, 4, 3, 3]
    assert shape.indices.tolist() == [0, 1, 4, 3, 1, 2, 5, 4, 0, 2, 4, 0, 1, 4]
    assert shape.uv_indices.tolist() == [0, 1, 4, 3, 1, 2, 5, 4, *[-1] * 6]
    assert scene.warnings[0] == f"{scene.path}: 2 of its 4 faces are without UVs: nothing is baked there"
    assert shape.rest[5].tolist() == [2, 1, 0] and shape.uvs[5].tolist() == [1, 1]
    assert shape.rest.dtype == np.float64


# The bake program's tests read the same table.
CASES = json.loads((REPOSITORY / "examples" / "tests" / "bake" / "obj.json").read_text("utf-8"))


@pytest.mark.parametrize("name", CASES["same"])
def test_ways_of_writing(tmp_path: Path, name: str) -> None:
    path = tmp_path / "a.obj"
    path.write_bytes(CASES["same"][name].encode("latin-1"))
    shape = Scene(path).shapes[0]
    assert shape.rest.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0.5]] and shape.face_counts.tolist() == [3]
    assert shape.uvs.tolist() == [[0, 0], [1, 0], [0, 1]]
    assert shape.indices.tolist() == shape.uv_indices.tolist() == [0, 1, 2]


@pytest.mark.parametrize("name", CASES["refused"])
def test_what_is_refused(tmp_path: Path, name: str) -> None:
    text, message = CASES["refused"][name]
    path = tmp_path / "a.obj"
    path.write_bytes(text.encode("latin-1"))
    refused(SceneError, rf"a\.obj: .*{re.escape(message)}", Scene, path)


def test_colours_are_rigidity(tmp_path: Path) -> None:
    coloured = "".join(f"{line} {c} {c} {c}\n" for line, c in zip(VERTICES.splitlines(), (0, 0.1, 0.25, 0.5, 1, 1)))
    path = write(tmp_path / "a.obj", coloured.replace("1 0 0 0.1 0.1 0.1", "1 0 0 0 1 0") + UVS + FACES)
    shape = Scene(path, SceneOptions(rigidity_primvar="colors")).shapes[0]
    assert shape.vertex_rigidity.tolist() == pytest.approx([0, 0.7152, 0.25, 0.5, 1, 1]) and shape.vertex_mask is None
    assert shape.rest[5].tolist() == [2, 1, 0]
    bare = write(tmp_path / "b.obj", VERTICES + UVS + FACES)
    refused(SceneError, r"b\.obj: not all vertices have a colour", Scene, bare, SceneOptions(mask_primvar="colors"))
    refused(SceneError, "'colors', not 'weights'", Scene, bare, SceneOptions(mask_primvar="weights"))


def test_poses(tmp_path: Path) -> None:
    rest = pose(tmp_path / "rest.obj", 2)
    for frame in (1, 2, 10):
        pose(tmp_path / f"pose.{frame:04}.obj", 2 + frame)
    scene = Scene(rest, SceneOptions(poses=(str(tmp_path / "pose.####.obj"),)))
    assert scene.frames == (1, 2, 10) and scene.positions("rest", 10)[2, 0] == 12
    assert scene.shapes[0].rest[2, 0] == 2
    refused(SceneError, "no pose 3, only 1 to 10", scene.positions, "rest", 3)
    options = SceneOptions(poses=(str(tmp_path / "pose.%04d.obj"),), rest="first")
    assert Scene(rest, options).shapes[0].rest[2, 0] == 3
    # Vertices alone are a pose, too, and a face may begin at another corner.
    write(tmp_path / "pose.0002.obj", VERTICES.replace("v 2 ", "v 7 "))
    pose(tmp_path / "pose.0010.obj", 8, "f 2 5 4 1\nf 2 3 6 5\n")
    assert scene.positions("rest", 2)[2, 0] == 7 and scene.positions("rest", 10)[2, 0] == 8


def test_poses_of_other_faces_are_named(tmp_path: Path) -> None:
    rest = pose(tmp_path / "rest.obj", 2)
    wrongs = {
        "f 1 2 5 4\nf 2 3 5 6\n": "face 2 has the vertices 1 2 4 5, but that of the rest mesh has 1 2 5 4",
        "f 1 2 5 4\n": "1 faces, but the rest mesh has 2",
        "f 1 2 5 4\nf 2 3 6 5\nf 1 2 3\n": "3 faces, but the rest mesh has 2",
        "f 1 2 5\nf 2 3 6 5\n": "face 1 has the vertices 0 1 4, ",
    }
    for number, (faces, message) in enumerate(wrongs.items()):
        scene = Scene(rest, SceneOptions(poses=(pose(tmp_path / f"wrong{number}.obj", 2, faces),)))
        refused(SceneError, rf"wrong{number}\.obj: {message}", scene.positions, "rest", scene.frames[0])
    scene = Scene(rest, SceneOptions(poses=(write(tmp_path / "few.obj", "v 0 0 0\n"),)))
    refused(SceneError, r"few\.obj: 1 vertices, but the rest mesh has 6", scene.positions, "rest", 1)


def test_options_that_obj_does_not_have(tmp_path: Path) -> None:
    path = pose(tmp_path / "a.obj", 2)
    for options in (SceneOptions(uv=("st",)), SceneOptions(subdivide=1), SceneOptions(rest="bind")):
        refused(SceneError, r"a\.obj: an OBJ file", Scene, path, options)
