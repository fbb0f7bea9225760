"""Models what each kernel takes on a GPU, without one: `python3 benches/gpu_model` writes benches/results/gpu-model.md.

Mesa's RADV compiles the kernels with its null device; one warp is timed on its assembly (warp.py) with counts from the
kernels' text (wgsl.py); dispatches and workgroups of whole solves come from benches/results/gpu-counts.md."""

import argparse
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
from gpu_model import report, solve, warp, wgsl
from gpu_model.solve import Kernel

ROOT = Path(__file__).resolve().parent.parent.parent
DRIVERS = (
    "/usr/share/vulkan/icd.d",
    "/etc/vulkan/icd.d",
    "/usr/local/share/vulkan/icd.d",
)
# What the null device compiles for: RDNA2 with 32 threads per wave, as many as a warp has.
NAVI = {
    "RADV_FORCE_FAMILY": "navi21",
    "NODEVICE_SELECT": "1",
    "RADV_PERFTEST": "cswave32",
    "MESA_SHADER_CACHE_DISABLE": "1",
}
# Marks may change what the compiler does: by at most this share of the instructions.
MARKS_MAY_CHANGE = 0.01


def declarations(root):
    """The declarations that all kernels begin with."""
    command = ["cargo", "run", "--quiet", "--manifest-path", str(root / "Cargo.toml")]
    command += ["--package", "vrtm-gpu", "--example", "declarations"]
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


def sources(root):
    """Name, entry and parts of each kernel in the table of kernels."""
    table = (root / "crates/gpu/src/kernels.rs").read_text()
    rows = re.finditer(r'^    (\w+) "(\w+)" \[([^\]]*)\]\s*\[', table, re.MULTILINE)
    return [(row[1], row[2], re.findall(r'"([^"]+)"', row[3])) for row in rows]


def forms(root, wanted):
    """The kernels to be modelled, in their forms: with slopes kept, or computed anew where memory is short."""
    shared = declarations(root)
    for name, entry, parts in sources(root):
        if wanted and not re.search(wanted, name):
            continue
        if name in solve.UNUSED:
            continue
        variants = [parts]
        anew = [part.replace("_kept", "_anew") for part in parts]
        if anew != parts:
            variants.append(anew)
        for variant in variants:
            files = [root / f"shaders/{part}.wgsl" for part in ("common", *variant)]
            form = [part.rsplit("_", 1)[-1] for part in variant if part.endswith(("_anew", "_kept"))]
            counted = f"{entry} ({parts[0]}"
            yield Kernel(
                name,
                entry,
                counted,
                " ".join(form),
                "\n".join([shared, *(file.read_text() for file in files)]),
            )


def driver():
    found = [file for folder in DRIVERS for file in Path(folder).glob("radeon_icd*.json")]
    if not found:
        sys.exit(
            "gpu_model: Mesa's driver RADV is not here (no radeon_icd*.json in " + ", ".join(DRIVERS) + "):\n"
            "install the package mesa-vulkan-drivers (Debian, Ubuntu); no GPU is needed."
        )
    return str(found[0])


def compiled(jobs, folder):
    """The assembly of each (entry, text)."""
    arguments = []
    for n, (entry, text) in enumerate(jobs):
        (folder / f"{n}.wgsl").write_text(text)
        arguments += [entry, str(folder / f"{n}.wgsl")]
    environment = dict(os.environ, VK_ICD_FILENAMES=driver(), **NAVI)
    command = [
        "cargo",
        "run",
        "--quiet",
        "--manifest-path",
        str(ROOT / "Cargo.toml"),
        "--package",
        "vrtm-gpu-model",
        "--",
    ]
    subprocess.run(command + arguments, env=environment, check=True)
    return [(folder / f"{n}.asm").read_text() for n in range(len(jobs))]


def change(kernel, assembly):
    """By what share of the instructions marks have changed the code, their own ones aside."""
    blocks = warp.blocks(assembly)
    own = sum(i.of_mark for _, code in blocks for i in code)
    plain = kernel.statistics["Instructions"]
    return (warp.statistics(assembly)["Instructions"] - own) / plain - 1


def compile_all(kernels, folder):
    """Compiles each kernel as it is and with marks; where marks change the code, again without those that do."""
    for kernel, assembly in zip(kernels, compiled([(k.entry, k.text) for k in kernels], folder)):
        kernel.statistics = warp.statistics(assembly)

    def marked(kernel, chosen=None):
        chosen = set(range(len(kernel.marks))) - kernel.left_out if chosen is None else chosen
        return kernel.entry, wgsl.with_marks(kernel.text, kernel.places, chosen)

    results = compiled([marked(kernel) for kernel in kernels], folder)
    changed = [k for k, assembly in zip(kernels, results) if abs(change(k, assembly)) > MARKS_MAY_CHANGE]
    trials = [(kernel, group) for kernel in changed for group in wgsl.groups(kernel.marks)]
    for (kernel, group), assembly in zip(trials, compiled([marked(k, group) for k, group in trials], folder)):
        if abs(change(kernel, assembly)) > MARKS_MAY_CHANGE:
            kernel.left_out |= group
    results = compiled([marked(kernel) for kernel in kernels], folder)
    for kernel, assembly in zip(kernels, results):
        kernel.changed = change(kernel, assembly)
        try:
            tree = warp.parts(assembly, kernel.marks)
        except wgsl.Failure as failure:
            raise wgsl.Failure(f"{kernel.name} {kernel.form}: {failure}") from failure
        kernel.warps = [warp.Warp(tree, kernel.marks, k) for k in range(len(kernel.sets))]


def run(options):
    kernels = list(forms(options.root, options.kernels))
    law = (options.root / "crates/core/src/method/law.rs").read_text()
    smoother_sweeps = int(re.search(r"SMOOTHER_SWEEPS: u32 = (\d+)", law)[1])
    for kernel in kernels:
        kernel.sets = solve.parameters(kernel.name, kernel.form, smoother_sweeps)
        try:
            kernel.places, kernel.marks = wgsl.marked(kernel.text, kernel.entry, kernel.sets)
        except wgsl.Failure as failure:
            raise wgsl.Failure(f"{kernel.name}: {failure}") from failure
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.keep or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        compile_all(kernels, folder)
    if options.kernels:
        print(
            report.kernels(kernels),
            *(report.parts(kernel) for kernel in kernels if options.parts),
            sep="\n",
        )
        return
    text = (options.root / "benches/results/gpu-counts.md").read_text()
    out = options.out or options.root / "benches/results/gpu-model.md"
    out.write_text(report.whole(kernels, solve.counted(text), text))
    print(f"written to {out}")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--kernels",
        default="",
        help="prints those kernels whose names match, and writes nothing",
    )
    parser.add_argument(
        "--parts",
        action="store_true",
        help="with --kernels: their loops and branches, too",
    )
    parser.add_argument(
        "--root",
        type=Path,
        default=ROOT,
        help="another checkout, whose shaders and counts are taken",
    )
    parser.add_argument("--out", type=Path, help="another file for the report")
    parser.add_argument("--keep", type=Path, help="a folder that keeps the assembly")
    try:
        run(parser.parse_args())
    except wgsl.Failure as failure:
        sys.exit(f"gpu_model: {failure}")


main()
