"""The tables of gpu-model.md."""

from . import solve
from .expressions import Failure

HEAD = """\
# What the kernels would take on an H100, by a model

No GPU was used: `python3 benches/gpu_model` writes this file anew, from Mesa's shader compiler and a model of one warp.
[What it knows and what it does not](../gpu_model/README.md). Its dispatches are those of the bulge in
[gpu-counts.md](gpu-counts.md). "Memory" is workgroup memory in bytes; "static" and "dynamic" are instructions, of the
code and on the critical path of a warp; "slots" are issue slots of a mean warp. "pbd" is the paper's solver, with 1 and
with 16 iterations on each level: the former are the 70 passes that the paper calls an iteration, the latter is the
default. A map has as many texels as the grid has cells; its time is that of the kernels, without the way over the bus.

"""
SIZES = (512, 2048)
# Scenes with many charts or tiles, which are solved together.
MESHES, MESH_SIZES = ("mh_face", "ict_inner"), (256, 512, 1024, 2048)


def kernels(all_kernels):
    """A row per kernel, form and set of parameters."""
    lines = [
        "| kernel | threads | VGPRs | memory | static | dynamic | cycles | slots |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for kernel in all_kernels:
        for label, warp in zip(kernel.sets, kernel.warps):
            name = " ".join(filter(None, (kernel.name, kernel.form, label)))
            s = kernel.statistics
            lines.append(
                f"| {name} | {kernel.threads} | {s['VGPRs']} | {s['LDS size']} | {s['Instructions']} | "
                f"{warp.instructions:.0f} | {warp.cycles:.0f} | {warp.slots:.0f} |"
            )
            spills = s["Spilled VGPRs"] + s["Spilled SGPRs"] + s["Scratch size"]
            if spills:
                lines[-1] += f" spills {spills}"
    return "\n".join(lines) + "\n"


def parts(kernel):
    """The loops and branches of a kernel that run, with what is in them, for its first set of values."""
    warp = kernel.warps[0]
    lines = [f"{kernel.name} {kernel.form}: {warp.instructions:.0f} instructions, {warp.cycles:.0f} cycles"]
    for depth, where, times, instructions, cycles in warp.parts:
        lines.append(f"{cycles:9.0f} cycles {instructions:7.0f} instructions {times:6.4g} times {'  ' * depth}{where}")
    return "\n".join(lines) + "\n"


def maps(all_kernels):
    """A row per map: what a fetch takes on the GPU, with as many texels as cells, and the bytes that are read back."""
    lines = [
        "| map | " + " | ".join(f"{n}²: ms | MB read back" for n in SIZES) + " |",
        "|---" * (2 * len(SIZES) + 1) + "|",
    ]
    kernel = {kernel.name: kernel for kernel in all_kernels}
    invert, redirect = kernel["Invert"], kernel["Redirect"]
    for label, warp in zip(redirect.sets, redirect.warps):
        cells = []
        for n in SIZES:
            ms = solve.dispatch(invert, invert.warps[0], (n // 16) ** 2) + solve.dispatch(redirect, warp, n * n // 64)
            cells.append(f"{ms:.3f} | {n * n * (4 if 'f16' in label else 8) / 1e6:.1f}")
        lines.append(f"| {label} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def defaults(all_kernels):
    """Of the forms of a kernel the first; kernels that are counted together share their dispatches."""
    default = {}
    for kernel in all_kernels:
        default.setdefault(kernel.counted, {}).setdefault(kernel.name, kernel)
    return default


def meshes(all_kernels, text):
    """A row per mesh and size, with a `normal` solve of all of its tiles."""
    default = defaults(all_kernels)
    lines = ["| scene | size | dispatches | empty ones | model, ms |", "|---|---|---|---|---|"]
    for scene in MESHES:
        counts = solve.counted(text, scene)
        of = counts.kernels["normal"]
        for size in MESH_SIZES:
            if size not in of or size not in counts.all["normal"]:
                continue
            dispatches, empty, _ = counts.all["normal"][size]
            known = [kernel for name in of[size] for kernel in default.get(name, {}).values()]
            ms = sum(solve.milliseconds(kernel, "normal", size, of) for kernel in known) + solve.EMPTY * empty
            lines.append(f"| {scene} | {size}² | {dispatches} | {empty} | **{ms:.2f}** |")
    return "\n".join(lines) + "\n"


def whole(all_kernels, counts, text):
    """The report; `text` is gpu-counts.md."""
    columns = [(q, n) for q in solve.QUALITIES for n in SIZES if n in counts.kernels[q]]
    default = defaults(all_kernels)
    rows, sums, unknown = {}, dict.fromkeys(columns, 0.0), set()
    for quality, size in columns:
        for name, (dispatches, _) in counts.kernels[quality][size].items():
            if name not in default:
                unknown.add(name)
                continue
            of = default[name].values()
            ms = sum(solve.milliseconds(kernel, quality, size, counts.kernels[quality]) for kernel in of)
            rows.setdefault(name, {})[quality, size] = (dispatches, ms)
            sums[quality, size] += ms
    if unknown:
        raise Failure(
            "gpu-counts.md is older than the kernels (`benches/gpu.sh --counts` writes it): " + "; ".join(unknown)
        )
    solves = [
        "| | " + " | ".join(f"`{q}` {n}²" for q, n in columns) + " |",
        "|---" * (len(columns) + 1) + "|",
    ]
    totals = [counts.all[q][n] for q, n in columns]
    empty = [solve.EMPTY * total[1] for total in totals]
    solves.append("| model, ms | " + " | ".join(f"**{sums[c] + e:.2f}**" for c, e in zip(columns, empty)) + " |")
    for k, what in enumerate(("dispatches", "empty dispatches", "barriers")):
        solves.append(f"| {what} | " + " | ".join(str(total[k]) for total in totals) + " |")
    solves.append("| strain, RMS | " + " | ".join(counts.strain[q][n] for q, n in columns) + " |")
    solves.append("| of the ms, empty dispatches | " + " | ".join(f"{e:.2f}" for e in empty) + " |")
    table = [
        "| kernel | " + " | ".join(f"`{q}` {n}²: dispatches | ms" for q, n in columns) + " |",
        "|---" * (2 * len(columns) + 1) + "|",
    ]
    order = sorted(rows, key=lambda name: -sum(ms for _, ms in rows[name].values()))
    for name in order:
        cells = [rows[name].get(column) for column in columns]
        cells = [f"{cell[0]} | {cell[1]:.3f}" if cell else "- | -" for cell in cells]
        table.append(f"| {next(iter(default[name]))} | " + " | ".join(cells) + " |")
    changed = [f"{k.name} {k.changed:+.0%}" for k in all_kernels if abs(k.changed) > 0.02]
    note = f"Marks change the number of instructions of: {', '.join(changed)}.\n\n" if changed else ""
    parts = [
        "## Solves\n",
        *solves,
        "\n## Kernels in solves\n",
        *table,
        "\n## Scenes with many charts\n",
        meshes(all_kernels, text),
        "## Maps\n",
        maps(all_kernels),
        "## Kernels\n",
    ]
    return HEAD + "\n".join(parts) + "\n\n" + note + kernels(all_kernels)
