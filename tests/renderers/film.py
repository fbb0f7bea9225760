"""Makes docs/images/head.webp: a head with metal studs that makes faces, with its own UVs and with the redirection.

    film.py FOLDER-OF-ASSETS OUT.webp

The example `render` draws it. Blender subdivides the mesh, as for any picture of a model; the expressions are those of
the asset, blended as shapes are on a rig.
"""

import json
import pathlib
import subprocess
import sys
import tempfile

import bpy
import numpy as np
from PIL import Image, ImageDraw, ImageFont

import figure
import model
import studs
import warp

SIZE = 4096  # texels of the textures, per side
GRID = 1024  # those of the rigidity map
RATE, FRAMES = 24, 132
WIDTH, HEIGHT = 800, 480
# Frame of the asset, its weight, and when it rises, is there, leaves and is gone, in seconds of the loop of 5.5.
PLAY = (
    (1, 1.0, 0.15, 0.65, 0.95, 1.45),
    (2, 1.0, 1.15, 1.65, 2.05, 2.50),
    (3, 1.0, 2.20, 2.70, 3.00, 3.45),
    (7, 1.0, 3.15, 3.60, 3.90, 4.30),
    (6, 0.9, 4.05, 4.50, 4.80, 5.35),
    (5, 0.8, 1.10, 1.60, 2.10, 2.60),
)
TURN = 9  # degrees to each side


def weight(time, start, there, leaves, gone):
    """0, then 1 from `there` to `leaves`, then 0: with continuous velocity and acceleration."""
    def ease(x):
        x = min(max(x, 0), 1)
        return x * x * x * (10 - 15 * x + 6 * x * x)
    return ease((time - start) / (there - start)) * (1 - ease((time - leaves) / (gone - leaves)))


def poses(rest, frames):
    """The frames of the loop."""
    middle = rest.mean(0)
    for k in range(FRAMES):
        time = k / RATE
        pose = rest + sum(much * weight(time, *times) * (frames[frame - 1] - rest) for frame, much, *times in PLAY)
        angle = np.radians(TURN) * np.sin(2 * np.pi * k / FRAMES)
        sin, cos = np.sin(angle), np.cos(angle)
        yield (pose - middle) @ np.array([[cos, 0, -sin], [0, 1, 0], [sin, 0, cos]]) + middle


def subdivide(mesh, shapes):
    """The mesh, subdivided once, and its shapes."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    made = bpy.data.meshes.new("head")
    made.from_pydata(shapes[0].tolist(), [], mesh.faces)
    layer = made.uv_layers.new(name="uv")
    layer.uv.foreach_set("vector", mesh.uvs[np.concatenate(mesh.uv_faces)].astype(np.float32).ravel())
    thing = bpy.data.objects.new("head", made)
    bpy.context.scene.collection.objects.link(thing)
    fine = thing.modifiers.new("fine", "SUBSURF")
    fine.levels, fine.uv_smooth, fine.boundary_smooth = 1, "PRESERVE_BOUNDARIES", "PRESERVE_CORNERS"
    out = []
    for shape in shapes:
        made.vertices.foreach_set("co", shape.astype(np.float32).ravel())
        made.update()
        bpy.context.view_layer.update()
        evaluated = thing.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        points = np.empty(3 * len(evaluated.vertices), np.float32)
        evaluated.vertices.foreach_get("co", points)
        out.append(points.reshape(-1, 3).astype(np.float64))
    corners = np.empty(len(evaluated.loops), np.int32)
    evaluated.loops.foreach_get("vertex_index", corners)
    uvs = np.empty(2 * len(corners), np.float32)
    evaluated.uv_layers[0].uv.foreach_get("vector", uvs)
    # UVs per corner, one entry each for those that are equal but for rounding: charts are found by what faces share.
    uvs, uv_corners = np.unique(uvs.reshape(-1, 2).round(6), axis=0, return_inverse=True)
    return model.Mesh(corners.reshape(-1, 4), uvs, out[0], uv_corners.reshape(-1, 4)), out


def quads(source):
    """The asset's polygons, which `model.asset` would cut into triangles."""
    mesh = model.asset(source, 1)
    corners = [line.split()[1:] for line in (source / "rest.obj").read_text().splitlines() if line.startswith("f ")]
    corners = [[[int(i) - 1 for i in word.split("/")[:2]] for word in words] for words in corners]
    mesh.faces = [[vertex for vertex, _ in face] for face in corners]
    mesh.uv_faces = [[uv for _, uv in face] for face in corners]
    return mesh


def paint(folder, mesh, rest):
    """Studs of metal with a rim, on skin: rigidity, colour, height."""
    # Two triangles of each quad.
    triangles, uv_triangles = (
        np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]) for quads in (mesh.triangles, mesh.uv_triangles)
    )
    skin = outside(uv_triangles, len(mesh.uvs))
    place, cavities = (
        studs.positions(model.Mesh(triangles[some], mesh.uvs, rest, uv_triangles[some]), rest, SIZE)
        for some in (skin, ~skin)
    )
    radius = 0.021 * (rest[:, 1].max() - rest[:, 1].min())
    distance = studs.distances(place, studs.centres(figure.clear_of_borders(place), 2.7 * radius), radius)
    # The grid has as many cells as the map has texels.
    rigidity = np.clip((1.08 - distance) * 8 + 0.5, 0, 1).reshape(GRID, SIZE // GRID, GRID, SIZE // GRID).mean((1, 3))
    warp.write(folder / "rigidity.1001.png", rigidity[..., None])
    inside = np.clip((1 - distance) * 12 + 0.5, 0, 1)[..., None]
    dome = 0.8 * np.sqrt(np.maximum(1.02 - np.minimum(distance, 1) ** 2, 0)) * (distance < 1)
    groove = 0.3 * np.exp(-(((distance - 1.08) / 0.12) ** 2))
    noise = np.random.default_rng(1).normal(size=(SIZE // 4, SIZE // 4))
    spectrum = np.fft.rfft2(noise)
    frequency = np.hypot(np.fft.fftfreq(SIZE // 4)[:, None], np.fft.rfftfreq(SIZE // 4)[None]) * SIZE
    pores = np.fft.irfft2(spectrum * np.exp(-((frequency / 500) ** 2)))
    pores = Image.fromarray((pores / pores.std()).astype(np.float32)).resize((SIZE, SIZE), Image.Resampling.BICUBIC)
    pores = np.asarray(pores)
    colour, metal = np.array([0.40, 0.15, 0.10]), np.array([1.0, 0.74, 0.32])
    light = colour * (1 + 0.035 * pores[..., None]) * (1 - 1.6 * groove[..., None])
    light = np.clip(light * (1 - inside) + metal * inside, 0, 1)
    light += neck(place, rest)[..., None] * (0.08 - light)
    # Dark, and as metal, which has no shine of its own.
    inner = ~np.isnan(cavities[..., 0])
    light[inner], inside[inner] = (0.03, 0.01, 0.008), 1
    colour = np.where(light < 0.0031308, light * 12.92, 1.055 * light ** (1 / 2.4) - 0.055)
    colour = np.concatenate([colour, 1 - inside], -1)
    Image.fromarray(np.rint(colour * 255).astype(np.uint8)).save(folder / "colour.png")
    height = np.clip(0.3 + 0.7 * (dome - groove) * 0.8 + 0.003 * pores * (1 - inside[..., 0]), 0, 1)
    Image.fromarray(np.rint(height * 65535).astype(np.uint16)).save(folder / "height.png")


def neck(place, rest):
    """1 where the surface ends behind the jaw, which fades into the backdrop, 0 on the face."""
    def ease(x):
        return np.clip(x, 0, 1) ** 2 * (3 - 2 * np.clip(x, 0, 1))
    low, high = rest.min(0), rest.max(0)
    place = (np.nan_to_num(place, nan=1e3) - low) / (high - low)
    return ease((0.30 - place[..., 1]) / 0.12) * ease((0.64 - place[..., 2]) / 0.17)


def outside(triangles, count):
    """Which triangles belong to the largest chart: the skin, without the mouth's and the eyes' cavities."""
    chart = np.arange(count)
    while True:
        least = chart.copy()
        np.minimum.at(least, triangles, chart[triangles].min(1, keepdims=True))
        if (least == chart).all():
            break
        chart = least
    chart = chart[triangles[:, 0]]
    return chart == np.bincount(chart).argmax()


def write(folder, mesh, rest, frames):
    """The asset's folder."""
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in rest] + [f"vt {u:.9g} {v:.9g}" for u, v in mesh.uvs]
    for face in np.stack([mesh.triangles, mesh.uv_triangles], -1) + 1:
        lines.append("f " + " ".join(f"{vertex}/{uv}" for vertex, uv in face))
    (folder / "rest.obj").write_text("\n".join(lines) + "\n")
    np.stack(frames).astype("<f4").tofile(folder / "frames.f32")
    facts = {"name": "head", "frames": len(frames), "rigidity": {"1001": "rigidity.1001.png"}}
    (folder / "asset.json").write_text(json.dumps(facts))


def encode(pictures, out):
    """One animated picture, with a title over each half."""
    font, frames = ImageFont.load_default(22), []
    for path in pictures:
        picture = Image.open(path).convert("RGB")
        draw = ImageDraw.Draw(picture)
        for middle, title in (WIDTH // 4, "original UVs"), (3 * WIDTH // 4, "vrtm"):
            draw.text((middle, HEIGHT - 24), title, (236, 236, 236), font, anchor="mm")
        draw.line([(WIDTH // 2, 0), (WIDTH // 2, HEIGHT)], (24, 24, 24), 2)
        frames.append(picture)
    # Times are whole milliseconds.
    ends = [round(1000 * (k + 1) / RATE) for k in range(len(frames))]
    times = [end - start for start, end in zip([0, *ends], ends)]
    frames[0].save(out, save_all=True, append_images=frames[1:], duration=times, loop=0, quality=42, method=4)


def main(assets, out, folder=None):
    source = pathlib.Path(assets) / "mh_face"
    mesh = quads(source)
    rest = [line.split()[1:4] for line in (source / "rest.obj").read_text().splitlines() if line.startswith("v ")]
    shapes = [np.array(rest, float)]
    shapes += list(np.fromfile(source / "frames.f32", "<f4").reshape(-1, len(rest), 3).astype(float))
    mesh, (rest, *frames) = subdivide(mesh, shapes)
    with tempfile.TemporaryDirectory() as made:
        made = pathlib.Path(folder or made)
        made.mkdir(exist_ok=True, parents=True)
        paint(made, mesh, rest)
        write(made, mesh, rest, list(poses(rest, frames)))
        command = ["cargo", "run", "--release", "--example", "render", "--", "--asset", made, "--film", f"1-{FRAMES}"]
        command += ["--colour", made / "colour.png", "--height", made / "height.png", "--bump", "0.006"]
        command += ["--size", f"{WIDTH}x{HEIGHT}", "--map", "1024", "--view", "-9,2", "--zoom", "1.2"]
        command += ["--middle", "0.0,-0.18", "--out", made / "pictures"]
        subprocess.run([str(word) for word in command], check=True)
        encode(sorted((made / "pictures").glob("film.*.png")), out)


if __name__ == "__main__":
    main(*sys.argv[1:])
