"""Warped copies of textures, against a reference in f64 that takes many samples of a texture given in closed form."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from bake_scenes import attributes, image, pixels, run, sheet, sheet_arguments, written
from conftest import centres, refused
from vrtm.bake.failure import Failure
from vrtm.bake.scene import SceneError
from vrtm.bake.warped import Copy, Texture, _footprint, listed, read, warp

SIZE = 256
SAMPLES = 8
Plane = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def painted(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Studs with soft edges, and fine waves."""
    distance = np.hypot((u * 8) % 1 - 0.5, (v * 8) % 1 - 0.5) / 8
    stud = 1 / (1 + np.exp(np.clip((distance - 0.036) * SIZE * 8 / 3, -60, 60)))
    waves = 0.5 + 0.5 * np.sin(2 * np.pi * u * 35) * np.sin(2 * np.pi * v * 28)
    return np.stack([stud, waves, 0.5 + 0.5 * np.sin(2 * np.pi * (20 * u + 17 * v))], axis=-1)


def moved(amount: float) -> Plane:
    """A redirection that keeps the tile's border."""

    def at(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        inside = amount * (np.sin(np.pi * u) * np.sin(np.pi * v)) ** 2
        return u + inside * np.sin(7 * u + 3) * np.cos(9 * v), v + inside * np.sin(6 * u) * np.cos(8 * v + 1)

    return at


def averaged(fine: np.ndarray) -> np.ndarray:
    return fine.reshape(SIZE, SAMPLES, SIZE, SAMPLES, -1).mean(axis=(1, 3))


def fetched(at: Plane) -> Callable[[str, int, int, int, int], np.ndarray]:
    """Fetches of the library, for a redirection in closed form."""
    u, v = centres(SIZE)
    step = 1e-6
    du = [(a - b) / (2 * step) for a, b in zip(at(u + step, v), at(u - step, v))]
    dv = [(a - b) / (2 * step) for a, b in zip(at(u, v + step), at(u, v - step))]
    there = at(u, v)
    kinds = {
        "redirection_delta": np.stack([there[0] - u, there[1] - v], axis=-1),
        "jacobian": np.stack([du[0], dv[0], du[1], dv[1]], axis=-1),
    }
    return lambda kind, width, height, first, rows: kinds[kind].astype(np.float32)[first : first + rows]


def texture(values: np.ndarray) -> Texture:
    return Texture("a.exr", values, ("R", "G", "B"), -1, {}, "openexr", "")


def noise(shape: tuple[int, ...], dtype: type) -> np.ndarray:
    """Texels of all values of a type; of floats, from 0 to 1."""
    most = 1 if np.dtype(dtype).kind == "f" else np.iinfo(dtype).max
    return (np.random.default_rng(len(shape)).random(shape) * most).astype(dtype)


@pytest.fixture(scope="module")
def source() -> np.ndarray:
    return averaged(painted(*centres(SIZE * SAMPLES))).astype(np.float32)


@pytest.mark.parametrize("amount", [0.03, 0.09])
def test_a_warped_texture_is_near_the_truth(source: np.ndarray, amount: float) -> None:
    at = moved(amount)
    truth = averaged(painted(*at(*centres(SIZE * SAMPLES))))
    found = warp(texture(source), Copy("a.exr", "a", False, False), fetched(at))
    # What one lookup per texel comes to, bilinear.
    there = oiio.ImageBuf(np.stack(at(*centres(SIZE)), axis=-1).astype(np.float32))
    plain = oiio.ImageBuf(oiio.ImageSpec(SIZE, SIZE, 3, "float"))
    assert oiio.ImageBufAlgo.st_warp(plain, oiio.ImageBuf(source), there, "triangle", flip_t=True)
    rms = {
        name: 255 * float(np.sqrt(np.mean((np.asarray(values) - truth) ** 2)))
        for name, values in {"moved": found, "bilinear": plain.get_pixels("float"), "as it is": source}.items()
    }
    print({name: round(value, 3) for name, value in rms.items()})
    assert rms["moved"] < 2.0
    assert rms["moved"] < 0.4 * rms["bilinear"]
    assert rms["as it is"] > 30


@pytest.mark.parametrize("is_normal", [False, True])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float16, np.float32])
def test_where_nothing_moves_the_copy_is_the_texture(dtype: type, is_normal: bool) -> None:
    values = noise((SIZE, SIZE, 3), dtype)
    found = warp(texture(values), Copy("a", "a", is_normal, False), fetched(moved(0.0)))
    assert found.dtype == dtype and np.array_equal(found, values)


def test_the_squeezed_is_filtered() -> None:
    """Waves that a map squeezes to less than two texels must become grey, not a pattern."""

    u, _ = centres(SIZE)
    waves = np.repeat((0.5 + 0.5 * np.sin(2 * np.pi * u * 80))[..., None], 3, axis=-1).astype(np.float32)

    def spread(factor: float) -> float:
        at = fetched(lambda u, v: (np.clip(0.5 + (u - 0.5) * factor, 0, 1), v))
        middle = np.s_[20:-20, SIZE // 2 - 30 : SIZE // 2 + 30]
        return warp(texture(waves), Copy("a", "a", False, False), at)[middle].std()

    assert spread(3.3) < 0.05 and spread(0.98) > 0.25


@pytest.mark.parametrize("down", [False, True])
def test_normals_turn_with_their_features(down: bool) -> None:
    """Bumps that a redirection turns: the normals of the turned heights are known."""
    angle = 0.5

    def at(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        # A point at `angle` shows what is at 0: the feature is turned forwards.
        x, y = u - 0.5, v - 0.5
        cosine, sine = np.cos(angle), np.sin(angle)
        return 0.5 + cosine * x + sine * y, 0.5 + cosine * y - sine * x

    def normals(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        slope_u = 1.2 * np.cos(2 * np.pi * 6 * u) * np.sin(2 * np.pi * 4 * v)
        slope_v = 0.8 * np.sin(2 * np.pi * 6 * u) * np.cos(2 * np.pi * 4 * v)
        found = np.stack([-slope_u, -slope_v, np.ones_like(u)], axis=-1)
        return found / np.linalg.norm(found, axis=-1, keepdims=True)

    flip = np.array([1, -1 if down else 1, 1])
    u, v = centres(SIZE)
    stored = (normals(u, v) * flip / 2 + 0.5).astype(np.float32)
    truth = normals(*at(u, v))
    cosine, sine = np.cos(angle), np.sin(angle)
    truth = truth @ np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]])
    found = (warp(texture(stored), Copy("a", "a", True, down), fetched(at)) * 2.0 - 1) * flip
    inside = (np.hypot(u - 0.5, v - 0.5) < 0.45)[..., None]
    assert np.allclose(np.linalg.norm(found, axis=-1), 1, atol=1e-5)
    degrees = np.degrees(np.arccos(np.clip((found * truth).sum(axis=-1, keepdims=True), -1, 1)))[inside]
    print(f"mean {degrees.mean():.3f}, p99 {np.percentile(degrees, 99):.3f} degrees")
    assert degrees.mean() < 0.1 and np.percentile(degrees, 99) < 0.5
    unturned = (warp(texture(stored), Copy("a", "a", False, down), fetched(at)) * 2.0 - 1) * flip
    assert np.degrees(np.arccos(np.clip((unturned * truth).sum(axis=-1, keepdims=True), -1, 1)))[inside].mean() > 10


WRAPS = {"wrapmodes": "periodic,mirror"}
"""Of textures with mip levels, by which renderers look them up."""


def test_copies_keep_what_their_textures_are(tmp_path: Path) -> None:
    scene = sheet(tmp_path, frames=1)
    cases = {
        "grey8": ("png", np.uint8, 1, {}, "png"),
        "srgb8": ("png", np.uint8, 3, {"oiio:ColorSpace": "srgb_rec709_scene"}, "png"),
        "packed8": ("png", np.uint8, 4, {}, "png"),
        "grey16": ("png", np.uint16, 1, {}, "png"),
        "layers16": ("tif", np.uint16, 6, {}, "tif"),
        "float": ("tif", np.float32, 3, {}, "exr"),
        "acescg": ("exr", np.float16, 3, {"colorInteropID": "lin_ap1_scene"}, "exr"),
        "deepcolour": ("exr", np.float32, 5, {}, "exr"),
        "photo": ("jpg", np.uint8, 3, {}, "png"),
        **{f"tx{n}": ("tx", kind, n, WRAPS, "tx") for n, kind in ((1, np.uint8), (3, np.float32), (4, np.uint16))},
        "tiled": ("exr", np.float16, 3, WRAPS, "exr"),
    }
    for name, (ending, dtype, channels, told, _) in cases.items():
        for udim in (1001, 1002):
            values = noise((40, 72, channels), dtype).repeat(2, axis=0)
            path = str(image(tmp_path / f"{name}.{udim}.{ending}", values, **told))
            if name in ("tx4", "tiled"):
                config = oiio.ImageSpec()
                config.attribute("wrapmodes", told["wrapmodes"])
                assert oiio.ImageBufAlgo.make_texture(oiio.MakeTxTexture, oiio.ImageBuf(path), path, config)
    patterns = [tmp_path / f"{name}.<UDIM>.{case[0]}" for name, case in cases.items()]
    out = tmp_path / "out"
    run(*sheet_arguments(scene, out, "--texture", *patterns))
    before = {p.name: p.read_bytes() for p in out.iterdir()}
    for name, (ending, dtype, channels, told, kept) in cases.items():
        for udim in (1001, 1002):
            source = pixels(tmp_path / f"{name}.{udim}.{ending}")
            found = pixels(out / f"{name}.0001.{udim}.{kept}")
            assert found.dtype == dtype and found.shape == (80, 72, channels)
            assert not np.array_equal(found, source)
            # What is outside of the charts does not move.
            assert np.array_equal(found[0], source[0])
            assert found.min() >= source.min() and found.max() <= source.max()
            if told is WRAPS:
                second, last = (pixels(out / f"{name}.0001.{udim}.{kept}", level) for level in (1, 6))
                assert last.shape == (1, 1, channels)
                half = found.reshape(40, 2, 36, 2, -1).mean((1, 3), dtype=np.float64)
                assert np.allclose(second, half, atol=1 if np.dtype(dtype).kind == "u" else 1e-3)
            for attribute, value in told.items():
                assert attributes(out / f"{name}.0001.{udim}.{kept}")[attribute] == value
    # Up to date, also in formats that have no attributes of one's own.
    assert written(run(*sheet_arguments(scene, out, "--texture", *patterns))) == (0, len(before))
    image(tmp_path / "grey8.1001.png", np.zeros((80, 72, 1), np.uint8))
    # A texture that has lost its coarsest level is made again, of the same bytes.
    for name in ("tx4.0001.1001.tx", "tiled.0001.1002.exr"):
        (out / name).write_bytes(before[name][:-10])
    assert written(run(*sheet_arguments(scene, out, "--texture", *patterns))) == (3, len(before) - 3)
    assert {p.name for p in out.iterdir() if p.read_bytes() != before[p.name]} == {"grey8.0001.1001.png"}


def test_wrong_textures(tmp_path: Path) -> None:
    refused(Failure, "redirect", listed, ("a/redirect.<UDIM>.png",), (), False)
    refused(Failure, "skin", listed, ("a/skin.<UDIM>.png",), ("b/skin.<UDIM>.exr",), False)
    kinds = [copy.kind for copy in listed(("a/<mesh>_skin_<UDIM>.png", "b.png"), ("c.<UDIM>.x.tif",), False)]
    assert kinds == ["skin", "b", "c.x"]
    two = image(tmp_path / "two.png", np.zeros((SIZE, SIZE, 2), np.uint8))
    refused(Failure, "three channels", Copy("", "", True, False).read, str(two))
    broken = tmp_path / "broken.png"
    broken.write_bytes(two.read_bytes()[:60])
    refused(SceneError, r"broken\.png", read, str(broken))


def test_the_footprint_has_the_covariance_that_is_missing() -> None:
    """J Jt - 1, less what is negative of it, in texels with y down; by numpy's eigenvectors."""
    random = np.random.default_rng(7)
    jacobians = np.eye(2) + random.normal(scale=0.6, size=(200, 2, 2))
    width, height = 512, 256
    axes = _footprint(jacobians.reshape(-1, 4).astype(np.float32), width, height).reshape(-1, 2, 2)
    assert (np.linalg.norm(axes[:, 0], axis=1) >= np.linalg.norm(axes[:, 1], axis=1)).all()
    # UVs to texels with y up, and that turned over.
    to_texels = np.diag([width, height])
    flip = np.diag([1, -1])
    for found, jacobian in zip(axes, jacobians):
        in_texels = to_texels @ jacobian @ np.linalg.inv(to_texels)
        values, vectors = np.linalg.eigh(in_texels @ in_texels.T - np.eye(2))
        wanted = flip @ (vectors * np.maximum(values, 0)) @ vectors.T @ flip
        assert np.allclose(found.T @ found, wanted, atol=1e-5)
