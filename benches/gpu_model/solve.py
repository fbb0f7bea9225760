"""Whole solves: with which parameters kernels run, how many dispatches and workgroups they take, and how long
a dispatch takes on all of a GPU."""

import re
from dataclasses import dataclass, field

from .expressions import Failure

# An H100: multiprocessors, registers and bytes of workgroup memory of each, cycles per millisecond; milliseconds of a
# dispatch beside its work (as measured), and of one that turns out empty.
PROCESSORS, REGISTERS, SHARED, CLOCK, LAUNCH, EMPTY = (
    132,
    65536,
    228 << 10,
    1.98e6,
    0.0045,
    0.0018,
)
# Kernels that no solve with default settings runs.
UNUSED = {
    "Previous", "Pull", "SamplesChords", "SamplesMetrics",
}  # fmt: skip
# Solves: the two qualities, and the paper's solver with 1 and with 16 iterations on each level.
QUALITIES = ("normal", "draft", "pbd 1", "pbd 16")
# Sweeps of relaxation per dispatch (crates/core/src/method/plan.rs).
SWEEPS = {"normal": 2, "draft": 1}
# Most blocks of a level on which four threads relax a node (crates/gpu/src/stages.rs).
WIDE_BLOCKS = 2048
# Passes of the smoother on the coarsest level have this many sweeps for one elsewhere (crates/core/src/method/law.rs).
COARSEST = 2
PLAIN = {
    "params.pull": 0.0, "params.hold": 0.0, "params.orientation_density": 0.0, "params.multiplier": 0.0,
    "params.has_last_step": 0, "params.is_identity": 0, "params.items": 1, "params.factor": 1.0, "beyond_patch": 0.0,
}  # fmt: skip
# How often a warp of `assemble` looks up a neighbour beyond its patch: with slopes kept, and computed anew.
BEYOND_PATCH = {"kept": 0.6, "anew": 0.19}


@dataclass
class Kernel:
    """A kernel in one of its forms. `counted` is how its row in gpu-counts.md begins; `sets` has the sets of values
    that it is modelled with, by their names, `warps` the result for each."""

    name: str
    entry: str
    counted: str
    form: str
    text: str
    sets: dict = field(default_factory=dict)
    places: list = field(default_factory=list)
    marks: list = field(default_factory=list)
    left_out: set = field(default_factory=set)
    statistics: dict = field(default_factory=dict)
    warps: list = field(default_factory=list)
    changed: float = 0.0

    @property
    def threads(self):
        size = re.search(rf"@workgroup_size\((\w+)\)\s*fn {self.entry}\(", self.text)[1]
        return int(size if size.isdecimal() else re.search(rf"const {size}: u32 = (\d+)u;", self.text)[1])


def parameters(name, form, smoother_sweeps):
    """The sets of values with which a kernel is modelled; words are constants of the shaders."""
    beyond = BEYOND_PATCH.get(form, 0.1) if name.startswith("Assemble") else 0.0
    plain = PLAIN | {"params.sweeps": smoother_sweeps, "beyond_patch": beyond}
    if name.startswith("Relax"):
        return {quality: plain | {"params.sweeps": sweeps} for quality, sweeps in SWEEPS.items()}
    if name == "MultigridDown":
        return {
            "coarser": plain | {"params.mode": "DOWN_GATHER"},
            "corrected": plain | {"params.mode": "DOWN_FROM_RESIDUAL"},
        }
    if name == "MultigridUp":
        modes = {"coarser": "UP_COARSE", "first": "UP_FIRST", "second": "UP_SECOND"}
        return {label: plain | {"params.mode": mode} for label, mode in modes.items()}
    if name == "MultigridCoarsest":
        return {"": plain | {"params.sweeps": COARSEST * smoother_sweeps}}
    if name == "Invert":
        # As many texels as cells.
        return {"": plain | {"request.workgroups_per_block": 1}}
    if name == "Redirect":
        # The origin of a tile's own UVs is 0.
        of = {"delta, f16": (1, 1), "delta, f32": (1, 0), "UV, f32": (0, 0)}
        return {
            label: plain | {"redirect_request.is_delta": delta, "redirect_request.is_half": half}
            for label, (delta, half) in of.items()
        }
    if name.startswith(("Project", "Regularise", "CopyState")):
        planes = {"Chords": 3, "Metrics": 2}.get(name.removeprefix("Project").removeprefix("Regularise"), 3)
        return {"": plain | {"params.mode": 0, "params.state_planes": planes}}
    if name.startswith("Energy"):
        return {"": plain | {"params.mode": "ENERGY_VALID"}}
    if name.startswith("Step"):
        return {"": plain | {"params.mode": "STEP_FIRST_TRIAL"}}
    return {"": plain}


def shares(kernel, quality, counts):
    """The numbers of the kernel's dispatches that run with each set of parameters."""
    of_entry = {entry.split()[0]: dispatches for entry, (dispatches, _) in counts.items()}
    dispatches, first, second = (
        counts[kernel.counted][0],
        of_entry.get("product", 0),
        of_entry.get("curvature", 0),
    )
    labels = list(kernel.sets)
    if kernel.name == "MultigridDown":
        given = {"coarser": dispatches - first, "corrected": first}
    elif kernel.name == "MultigridUp":
        given = {
            "coarser": dispatches - first - second,
            "first": first,
            "second": second,
        }
    else:
        given = {quality if quality in labels else labels[0]: dispatches}
    if set(given) - set(labels) or min(given.values()) < 0:
        raise Failure(
            f"{kernel.name}: {dispatches} dispatches in {quality} are not understood: "
            "gpu-counts.md is older than the kernels"
        )
    return [given.get(label, 0) for label in labels]


def dispatch(kernel, warp, groups):
    """Milliseconds of a dispatch of so many workgroups: those of its slowest warp or, where there are many, of all
    issue slots of a multiprocessor's four schedulers."""
    warps = -(-kernel.threads // 32)
    registers = max(kernel.statistics["VGPRs"], 32)
    resident = min(
        32,
        REGISTERS // (registers * warps * 32),
        SHARED // (kernel.statistics["LDS size"] + 1024),
        64 // warps,
    )
    slots, each = warps * warp.slots / 4, groups / PROCESSORS
    if each <= 1:
        return LAUNCH + max(warp.cycles, slots) / CLOCK
    waves = max(1, -(-groups // (PROCESSORS * max(1, resident))))
    return LAUNCH + waves * max(warp.cycles, each / waves * slots / 0.9) / CLOCK


def rungs(name, size, counts):
    """The kernel's dispatches by their workgroups: pairs of dispatches and workgroups of each. What a size has more
    than half of it belongs to its finest level."""
    dispatches, groups = counts[size].get(name, (0, 0))
    out = []
    while dispatches:
        fewer, smaller = counts.get(size // 2, {}).get(name, (0, 0))
        if not 0 < fewer < dispatches or smaller >= groups:
            break
        out.append((dispatches - fewer, (groups - smaller) / (dispatches - fewer)))
        dispatches, groups, size = fewer, smaller, size // 2
    return out + ([(dispatches, groups / dispatches)] if dispatches else [])


def is_taken(kernel, groups):
    """True if dispatches of so many workgroups take this form of a kernel: a block colour has a quarter of a level."""
    return not kernel.name.startswith("Relax") or (4 * groups <= WIDE_BLOCKS) == kernel.name.endswith("Wide")


def milliseconds(kernel, quality, size, counts):
    """Milliseconds of all the kernel's dispatches in a solve."""
    share = shares(kernel, quality, counts[size])
    total = sum(share)
    return sum(
        number * part / total * dispatch(kernel, warp, groups)
        for number, groups in rungs(kernel.counted, size, counts)
        if is_taken(kernel, groups)
        for part, warp in zip(share, kernel.warps)
        if part
    )


@dataclass
class Counts:
    """Counts of a scene in gpu-counts.md: per quality and size dispatches and workgroups of each kernel; dispatches,
    empty ones and barriers of all; and the strain that is left, if it is told."""

    kernels: dict
    all: dict
    strain: dict


def counted(text, scene="bulge"):
    kernels, totals, strain = ({quality: {} for quality in QUALITIES} for _ in range(3))
    row = rf"^\| {scene} \| (\d+)² \| \d+ \| (\d+ \| \d+ \| \d+) \|"
    for size, numbers in re.findall(row, text, re.MULTILINE):
        totals["normal"][int(size)] = [int(number) for number in numbers.split(" | ")]
    for part in text.split("\n## ")[1:]:
        head = re.match(
            scene + r" at (\d+)², (?:kernel by kernel|`([\w ]+)`: (\d+) .*?, (\d+) .*?, (\d+) barriers)",
            part,
        )
        if not head:
            continue
        quality, size = head[2] or "normal", int(head[1])
        told = re.search(r", strain ([\d.]+)$", part.split("\n")[0])
        strain[quality][size] = told[1] if told else "-"
        if head[2]:
            totals[quality][size] = [int(number) for number in head.groups()[2:]]
        rows = re.findall(r"^\| (\w+ \([^,)]*).*?\) \| (\d+) \| (\d+) \|", part, re.MULTILINE)
        kernels[quality][size] = {name: (int(dispatches), int(groups)) for name, dispatches, groups in rows}
    return Counts(kernels, totals, strain)
