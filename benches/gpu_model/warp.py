"""One warp on an H100, by an in-order scoreboard on the assembly of AMD's compiler (ACO)."""

import itertools
import re

from .expressions import Failure
from .wgsl import MAGIC, MARKS

# Cycles until a dependent instruction may issue, from the literature on Hopper; and issue slots that it takes.
LATENCY = {
    "alu": 4.5,
    "mul": 6,
    "special": 22,
    "shared": 29,
    "shared_write": 4,
    "far": 200,
    "near": 38,
    "scalar_load": 15,
    "scalar": 4.5,
    "write": 4,
}
SLOTS = {
    "alu": 1,
    "mul": 2,
    "special": 4,
    "shared": 2,
    "shared_write": 2,
    "far": 4,
    "scalar_load": 2,
    "scalar": 1,
    "write": 4,
}
BARRIER, BRANCH = 25, 8
NOTHING = re.compile(r"s_(waitcnt\w*|clause|nop|inst_prefetch|endpgm|code_end|sleep|setprio|delay_alu)$")
SETS_SCC = re.compile(r"s_(add|sub|and|or|xor|andn2|orn2|not|lsh|ash|bfe|min|max|abs|nand|nor|mulk|mul_hi)")
READS_TARGET = re.compile(r"v_(fmac|mac|pk_fmac|dot2c|writelane)|s_(mulk|addk)")


def kind(op):
    """The kind of an instruction; None if it takes no time."""
    if NOTHING.match(op):
        return None
    if op == "s_barrier":
        return "barrier"
    if re.match(r"s_(cbranch|branch|subvector)", op):
        return "branch"
    if re.match(r"s_(buffer_load|load)", op):
        return "scalar_load"
    if op.startswith("s_"):
        return "scalar"
    if op.startswith("ds_"):
        return "shared_write" if re.match(r"ds_(write|add_u|max_u|or_b)", op) and "rtn" not in op else "shared"
    if re.match(r"(buffer|global)_(store|atomic)", op):
        return "write"
    if re.match(r"(buffer|global|scratch|flat)_", op):
        return "far"
    if re.match(r"v_(rcp|rsq|sqrt|sin|cos|log|exp)_", op):
        return "special"
    return "mul" if re.match(r"v_(mul_hi|mul_lo|mad_u64)", op) else "alu"


def registers(word):
    word = word.strip().strip("-|")
    if found := re.match(r"([vs])(\d+)$", word):
        return [word]
    if found := re.match(r"([vs])\[(\d+):(\d+)\]$", word):
        return [f"{found[1]}{n}" for n in range(int(found[2]), int(found[3]) + 1)]
    if word in ("vcc", "vcc_lo", "vcc_hi"):
        return ["vcc"]
    return ["exec"] if word.startswith("exec") else ["scc"] if word.endswith("scc") else ["m0"] if word == "m0" else []


class Instruction:
    def __init__(self, text, constants):
        """`constants` are the values of registers that moves have set so far."""
        self.op, _, rest = text.partition(" ")
        words = [word.strip().split(" ")[0] for word in rest.split(",")] if rest else []
        self.kind, self.target, self.mark = kind(self.op), None, None
        self.reads, self.writes, self.of_mark = [], [], False
        if self.op == "ds_write_b32" and MAGIC <= constants.get(words[1], 0) < MAGIC + MARKS:
            self.mark, self.kind, self.of_mark = constants[words[1]] - MAGIC, None, True
        elif self.kind == "branch":
            self.target = words[0] if words else None
            self.reads = [name for name in ("scc", "vcc", "exec") if name in self.op]
        elif self.kind not in (None, "barrier"):
            self._use([registers(word) for word in words])

        if self.op.startswith(("s_mov_b32", "v_mov_b32")) and len(words) == 2:
            value = int(words[1], 0) if re.match(r"-?(0x)?[0-9a-f]+$", words[1]) else constants.get(words[1])
            constants.pop(words[0], None)
            if value is not None:
                constants[words[0]] = value
                if MAGIC <= value < MAGIC + MARKS:
                    self.kind, self.of_mark = None, True
        else:
            for register in self.writes:
                constants.pop(register, None)

    def _use(self, used):
        op, every = self.op, list(itertools.chain(*used))
        if self.kind in ("write", "shared_write"):
            self.reads = every
        elif op.startswith("v_cmpx"):
            self.reads, self.writes = every, ["exec"]
        elif op.startswith(("s_cmp", "s_bitcmp")):
            self.reads, self.writes = every, ["scc"]
        else:
            self.writes, self.reads = (
                list(used[0]) if used else [],
                list(itertools.chain(*used[1:])),
            )
            if op.startswith("v_cmp") and not self.writes:
                self.writes = ["vcc"]
            if self.kind == "scalar" and SETS_SCC.match(op):
                self.writes.append("scc")
            if "saveexec" in op:
                self.writes.append("exec")
                self.reads.append("exec")
            if op.startswith(("s_cselect", "s_addc", "s_subb", "s_cmov")):
                self.reads.append("scc")
            if op.startswith("v_div_fmas") or op == "v_cndmask_b32_e32":
                self.reads.append("vcc")
            if READS_TARGET.match(op):
                self.reads += self.writes


def statistics(assembly):
    return {name: int(value) for name, value in re.findall(r"^# (.*?) = (\d+)$", assembly, re.MULTILINE)}


def blocks(assembly):
    """Names and instructions of the basic blocks, in their order."""
    out, constants = [], {}
    for line in assembly.split("\n"):
        line = line.split(";")[0].rstrip()
        if found := re.match(r"(BB\d+):", line):
            out.append((found[1], []))
        elif line.startswith("\t") and out:
            out[-1][1].append(Instruction(" ".join(line.split()), constants))
    # The move before a mark sets its address.
    for _, code in out:
        for before, i in itertools.pairwise(code):
            if i.mark is not None and before.op == "v_mov_b32_e32" and not before.of_mark:
                before.kind, before.of_mark = None, True
    return out


class Part:
    """Instructions, loops and regions in their order. `mark` says how often it runs, `copies` how often its body stands
    in the code of one run of the loop."""

    def __init__(self, mark=None, until=None):
        self.mark, self.until, self.items, self.copies = mark, until, [], 1


def parts(assembly, marks):
    """The tree of loops and regions. Fails where a loop of the assembly is none of the text."""
    code = blocks(assembly)
    at = {name: k for k, (name, _) in enumerate(code)}
    loops = {}
    for k, (_, instructions) in enumerate(code):
        for i in instructions:
            if i.target in at and at[i.target] <= k:
                loops[at[i.target]] = max(loops.get(at[i.target], 0), k)
    root = Part()
    stack = [root]

    def own_mark(head, end):
        inside = [i.mark for _, code_of in code[head : end + 1] for i in code_of if i.mark is not None]
        own = [mark for mark in inside if marks[mark].kind == "loop"]
        inner = [range(a, b + 1) for a, b in loops.items() if head < a and b <= end]
        outside = [
            i.mark for k in range(head, end + 1) if not any(k in r for r in inner)
            for i in code[k][1] if i.mark is not None and marks[i.mark].kind == "loop"
        ]  # fmt: skip
        if not own or own[0] not in outside:
            raise Failure(f"the loop from {code[head][0]} to {code[end][0]} of the assembly is none of the text")
        copies = outside.count(own[0])
        if copies > 1 and copies >= max(marks[own[0]].counts):
            # It is unrolled, so the loop in the assembly is one around it.
            raise Failure(f"no mark of the loop around: {marks[own[0]].where}")
        return own[0], copies

    for k, (_, instructions) in enumerate(code):
        if k in loops:
            mark, copies = own_mark(k, loops[k])
            part = Part(mark, loops[k])
            part.copies = copies
            stack[-1].items.append(part)
            stack.append(part)
        for i in instructions:
            if i.mark is None:
                stack[-1].items.append(i)
                continue
            mark = marks[i.mark]
            if mark.kind == "region":
                part = Part(i.mark)
                stack[-1].items.append(part)
                stack.append(part)
            elif mark.kind == "end":
                if stack[-1].mark != mark.counts[0] or stack[-1].until is not None:
                    raise Failure(f"the end of a region without its beginning: {mark.where}")
                stack.pop()
            elif mark.kind == "near":
                stack[-1].items.append("near")
        while stack[-1].until == k:
            stack.pop()
    if len(stack) != 1:
        raise Failure(f"a region without an end: {marks[stack[-1].mark].where}")
    return root


class Warp:
    """Cycles and instructions of a warp on the critical path, and issue slots of a mean warp, for set `n` of values."""

    def __init__(self, root, marks, n):
        self.marks, self.n = marks, n
        self.near = False
        self.instructions = self.slots = 0.0
        # Per part that runs: its depth, its line, how often it runs in all, its instructions and cycles in all.
        self.parts = []
        self.cycles = self._run(root, 1.0, 1.0)

    def _run(self, part, times, share, depth=0):
        """Cycles of one run of a part that runs `times` times, in `share` of the warps."""
        cycles, now, ready = 0.0, 0.0, {}
        for item in part.items:
            if isinstance(item, Part):
                mark = self.marks[item.mark]
                count = mark.counts[self.n] / item.copies
                if mark.kind == "loop" or count:
                    cycles, now, ready = cycles + now, 0.0, {}
                if count:
                    row = [depth, mark.where, times * count, self.instructions, 0.0]
                    self.parts.append(row)
                    each = self._run(item, times * count, share * count / mark.warps, depth + 1)
                    row[3:] = self.instructions - row[3], times * count * each
                    cycles += count * each
            elif item == "near":
                self.near = True
            elif item.kind is not None:
                self.instructions += times
                if item.kind == "barrier":
                    now += BARRIER
                    self.slots += share
                    continue
                start = max([now, *(ready.get(register, 0.0) for register in item.reads)])
                slots = SLOTS.get(item.kind, 1)
                self.slots += share * slots
                now = start + (BRANCH if item.kind == "branch" else slots)
                latency = LATENCY.get("near" if item.kind == "far" and self.near else item.kind, 0)
                for register in item.writes:
                    ready[register] = start + latency
        return cycles + now
