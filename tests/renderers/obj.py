"""OBJ files: positions, UVs, and polygons as a vertex and a UV for each of their corners."""

import numpy as np


def read(path):
    """Positions (n, 3), UVs (m, 2), the number of corners of each polygon, and the corners (k, 2)."""
    positions, uvs, counts, corners = [], [], [], []
    for line in path.read_text().splitlines():
        kind, *words = line.split() or [""]
        if kind == "v":
            positions.append([float(x) for x in words[:3]])
        elif kind == "vt":
            uvs.append([float(x) for x in words[:2]])
        elif kind == "f":
            counts.append(len(words))
            corners += [[int(i) - 1 for i in word.split("/")[:2]] for word in words]
    return np.array(positions), np.array(uvs), np.array(counts), np.array(corners)


def write(path, positions, uvs, counts, corners):
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in positions] + [f"vt {u:.9g} {v:.9g}" for u, v in uvs]
    words = [f"{vertex + 1}/{uv + 1}" for vertex, uv in corners]
    ends = np.cumsum(counts)
    lines += ["f " + " ".join(words[end - count : end]) for count, end in zip(counts, ends)]
    path.write_text("\n".join(lines) + "\n")


def fans(counts):
    """Triangles (t, 3) of corners' numbers: a fan for each polygon."""
    first = np.repeat(np.cumsum(counts) - counts, counts - 2)
    step = np.concatenate([np.arange(1, n - 1) for n in counts])
    return np.stack([first, first + step, first + step + 1], -1).astype(int)
