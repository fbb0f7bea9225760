"""The normal map's frame in the document's GLSL and WGSL, by their own lines, on surfaces whose frame is known.

No program here draws them. Their lines are arithmetic on vectors that Python can do when the types are taken away; the
derivatives over the screen are those of planes, of charts that are mirrored or not.
"""

import re

import numpy as np

from checks import check, document, run

NAMES = {
    "sign": np.sign,
    "dot": np.dot,
    "cross": np.cross,
    "normalize": lambda v: v / np.linalg.norm(v),
    "select": lambda no, yes, condition: yes if condition else no,
}


class Vector(np.ndarray):
    x, y, z = (property(lambda self, i=i: self[i]) for i in range(3))


def vector(*numbers):
    return np.array(numbers, np.float64).view(Vector)


def frame(language):
    """The lines from the surface's normal to the turned one, as Python."""
    lines = document(language.upper(), language).split("// The normal map's frame")[1].split("lit = ")[0].splitlines()[1:]
    text = "\n".join(line.strip() for line in lines[:-1])
    text = re.sub(r"\b(vec3|float|let) ", "", text).replace(";", "")
    text = re.sub(r"\* \((.*) \? (\S+) : (\S+)\)$", r"* (\2 if \1 else \3)", text, flags=re.M)
    # Several in a line.
    text = re.sub(r", (\w+ = )", r"\n\1", text)
    return compile(text, language, "exec")


def turn(code, n, uv, position, normal):
    """`uv` and `position`: their derivatives by the screen's x and y, which stand for the calls that take them."""
    values = dict(NAMES, normal=normal, dx=uv[0], dy=uv[1])
    values["p"] = type("Point", (), {"normal": normal, "position": position})
    values["position"] = position
    for i, names in enumerate((("dFdx", "dpdx"), ("dFdy", "dpdy"))):
        for name in names:
            values[name] = lambda what, i=i: what[i]
    exec(code, values)
    T, B, N = values["T"], values["B"], values["N"]
    return n[0] * T + n[1] * B + n[2] * N


def frames():
    random = np.random.default_rng(1)
    for language in "glsl", "wgsl":
        code = frame(language)
        for name, side in ("plain", 1), ("mirrored", -1):
            worst = 0
            for _ in range(100):
                # The redirected u and v run along two orthogonal axes, with any derivatives over the screen.
                u, v, _ = axes = np.linalg.qr(random.normal(size=(3, 3)))[0]
                normal, screen, n = side * np.cross(u, v), random.normal(size=(2, 2)), random.normal(size=3)
                got = turn(code, n, [vector(*row) for row in screen], list(screen @ axes[:2]), normal)
                worst = max(worst, np.abs(got - (n[0] * u + n[1] * v + n[2] * normal)).max())
            check(f"{language}: the normals' frame on a {name} chart", worst < 1e-9, f"largest error {worst:.0e}")


run(frames)
