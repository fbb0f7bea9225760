"""Prints the CPU kernels of a solve as a table, for kernels.sh: joins counts per instruction with the disassembly.

kernels.py PROGRAM NODES LEVEL=COUNTS..., with the active nodes of the solve, and levels as the table's head names them.
COUNTS is a file of callgrind, or one of its kind without caches.
"""

import re
import subprocess
import sys
from collections import Counter, defaultdict

BLOCK = 256  # nodes, which a call of a kernel works on
LINE = 64  # bytes of the cache
LEAST = 0.005  # of all instructions: functions with fewer share a row
FETCHED = {"D1mr": "cache", "D1mw": "cache", "DLmr": "memory", "DLmw": "memory"}
KERNEL = re.compile(r"lanes::dispatch(?:::\w+::)?<vrtm_cpu::([\w:]+)(?:<.*(Chords|Metrics)>)?")
STACK = re.compile(r"\[(rsp|rbp)\b")
LANES = {"ss": {}, "sd": {}, "ps": {"x": 4, "y": 8, "z": 16}, "pd": {"x": 2, "y": 4, "z": 8}}
# Instructions that only read their first operand, and those that only write it.
READS = ("cmp", "test", "push", "ucomi", "vucomi", "comi", "vcomi", "call", "jmp", "prefetch", "bt", "mul", "div")
WRITES = re.compile("v?(p?mov|mask|set|cvt|p?extr)")


def executions(path, program):
    """Executions of the instruction at each address of the program, and bytes that it fetched."""
    found, is_inside, is_call, events = defaultdict(Counter), True, False, []
    for line in open(path):
        if line.startswith("events:"):
            events = line.split()[2:]
        elif line.startswith("ob="):
            is_inside = line[3:].strip() == program
        elif line.startswith("calls="):
            is_call = True
        elif line.startswith("0x"):
            address, _, count, *others = line.split()
            # In libraries callgrind counts each byte that an instruction fills or copies.
            here = found[int(address, 16)] if is_inside else Counter()
            # A line after `calls=` has what the called function took.
            here["all"] += 0 if is_call else int(count)
            for event, value in zip(events, others):
                if event in FETCHED:
                    here["called " * is_call + FETCHED[event]] += LINE * int(value)
            is_call = False
    return found


def kinds(mnemonic, operands, has_frame):
    """Loads from the stack, stores to it, quotients and roots of one instruction."""
    first, _, others = operands.partition(",")
    here, there = [bool(m) and (has_frame or m[1] == "rsp") for m in map(STACK.search, (first, others))]
    is_written = here and not mnemonic.startswith(READS)
    is_read = there or (here and not (is_written and WRITES.match(mnemonic)))
    root = re.match(r"v?(?:div|sqrt)([ps][sd])$", mnemonic)
    is_access = mnemonic not in ("lea", "nop")
    return {
        "loads": is_access and is_read,
        "stores": is_access and is_written,
        "roots": LANES[root[1]].get(first[0], 1) if root else 0,
    }


def functions(program, levels):
    """Symbols of functions, each with sums per level."""
    command = ["objdump", "-dCMintel", "--no-show-raw-insn", program]
    found = []
    for line in subprocess.Popen(command, stdout=subprocess.PIPE, text=True).stdout:
        if line.endswith(">:\n"):
            start, sums, has_frame = int(line[:16], 16), [Counter() for _ in levels], False
            found.append((line[18:-3], sums))
        elif line.startswith(" "):
            at, _, instruction = line.partition(":")
            at, (mnemonic, _, operands) = int(at, 16), instruction.split("#")[0].strip().partition(" ")
            has_frame = has_frame or (mnemonic, operands.strip()) == ("mov", "rbp,rsp")
            for level, total in zip(levels, sums):
                if at in level:
                    count = level[at]["all"]
                    total.update(level[at])
                    total.update({kind: n * count for kind, n in kinds(mnemonic, operands.strip(), has_frame).items()})
                    total["calls"] += count if at == start else 0
    return found


def title(symbol):
    """A kernel's name, or that of another function without its parameters."""
    kernel = KERNEL.search(symbol)
    if kernel:
        return kernel[1] + (f", {kernel[2].lower()}" if kernel[2] else "")
    symbol, nested = re.sub(r"^<([^<>]+)>", r"\1", symbol), 1
    while nested:
        symbol, nested = re.subn(r"(::)?<[^<>]*>|::\{closure#\d+\}", "", symbol)
    return symbol


def main():
    """Prints the table; the first level orders its rows."""
    program, nodes, *files = sys.argv[1:]
    heads, paths = zip(*(file.split("=", 1) for file in files))
    levels = [executions(path, program) for path in paths]
    whole = [sum(level.values(), Counter()) for level in levels]
    found = functions(program, levels)
    kernels = {title(symbol) for symbol, _ in found if KERNEL.search(symbol)}
    rows = defaultdict(lambda: [Counter() for _ in levels])
    for symbol, sums in found:
        for total, more in zip(rows[title(symbol)], sums):
            total.update(more)
    places = [place for place in ("cache", "memory") if place in whole[0]]

    def row(name, sums, nodes):
        """Prints a row of numbers per node, or for 0 nodes the share alone."""
        cells = [value for level in sums for value in (level["all"], level["loads"], level["stores"])]
        cells += [sums[0]["roots"], *(sums[0][place] + sums[0]["called " + place] for place in places)]
        share = f"{100 * sums[0]['all'] / whole[0]['all']:.1f}"
        calls = sums[0]["calls"] if name in kernels else ""
        print(f"| {name} | {calls} | {share} |", *(f"{n / nodes:.1f} |" if nodes else "|" for n in cells))

    columns = [*(column for head in heads for column in (head, "loads", "stores")), "roots", *places]
    print("| kernel | calls | % |", " | ".join(columns), "|")
    print("|" + "---|" * (3 + len(columns)))
    others, solve = [[Counter() for _ in levels] for _ in range(2)]
    for name, sums in sorted(rows.items(), key=lambda item: -item[1][0]["all"]):
        is_row = sums[0]["all"] > LEAST * whole[0]["all"]
        if name in kernels and sums[0]["calls"]:
            row(name, sums, BLOCK * sums[0]["calls"])
        elif is_row:
            row(name, sums, 0)
        for k, more in enumerate(sums):
            solve[k].update({key: n for key, n in more.items() if not key.startswith("called")})
            others[k].update({} if is_row or name in kernels else more)
    row("others", others, 0)
    row("**all, per active node**", solve, int(nodes))


main()
