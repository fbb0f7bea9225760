"""Counts of the runs of a kernel's parts, and marks in its text by which these are found again in a compiler's output.

Counts follow from the text where it has them: a loop `for (var k = t; k < WINDOW; k += 64u)` is run with thread 0, and
an `if params.pull > 0.0` is judged with the parameters of a solve. Where a count depends on data, a comment at the end
of the line says it, to be kept with the code:

    while low < high { // model: 3 times
    if crowded { // model: 0 times
    let found = search(at); // model: 0 times
    if t / 64u == colour { // model: 1 times in 1 of 4 warps
    if inside { // model: 1 times, else 0.1 times
    // model: near               (loads that follow hit the first cache)

A mark writes a constant that occurs nowhere else into workgroup memory: MAGIC plus its number.
"""

import re
from dataclasses import dataclass

from .expressions import Failure, Unknown, evaluate, runs

MARKS = 1000
# A mark's value in the assembly: this plus its number.
MAGIC = 0x5EED0000
DIRECTIVE = re.compile(r"//\s*model:\s*(?:(near)|(.+?) times(?:, else (.+?) times)?(?: in 1 of (\d+) warps)?)\s*$")
LOOPS = ("for", "while", "loop")
KEEP = "let model_value ="
JUMP = re.compile(r"(\b(return|break|continue)\b[^;{}]*;)\s*$")


@dataclass
class Mark:
    """A place in the text. `counts` has the times that a loop's body or a region runs, per set of parameters."""

    kind: str
    where: str
    counts: list
    warps: int


def arguments(text, at):
    """The arguments of the call whose parenthesis opens at `at`."""
    depth, parts, begin = 0, [], at + 1
    for k in range(at, len(text)):
        depth += (text[k] in "([{") - (text[k] in ")]}")
        if depth == 0 or (depth == 1 and text[k] == ","):
            parts.append(text[begin:k].strip())
            begin = k + 1
        if depth == 0:
            return [part for part in parts if part]
    return parts


class Function:
    """A function of the text, from the beginning of its body to its end."""

    def __init__(self, name, parameters, begin, end):
        self.name, self.begin, self.end = name, begin, end
        self.parameters = [(p, "local_invocation_index" in a) for a, p in parameters]


class Text:
    """A kernel's text with its comments blanked, so that places stay."""

    def __init__(self, text):
        self.text, self.directives = text, {}
        plain, at = [], 0
        for line in text.split("\n"):
            code = line.split("//")[0]
            if found := DIRECTIVE.search(line):
                self.directives[at + len(code.rstrip())] = found
            elif re.search(r"//\s*model:", line):
                raise Failure(f"not understood: {line.strip()}")
            plain.append(code.ljust(len(line)))
            at += len(line) + 1
        self.plain = "\n".join(plain)
        self.constants = {}
        for name, value in re.findall(r"^const (\w+)(?:: \w+)? = ([^;]+);", self.plain, re.MULTILINE):
            try:
                self.constants[name] = evaluate(value, self.constants)
            except Unknown:
                pass
        self.functions = {}
        for found in re.finditer(r"\bfn (\w+)\(", self.plain):
            inside = arguments(self.plain, found.end() - 1)
            parameters = [re.match(r"(.*?)(\w+)\s*:", part, re.DOTALL).groups() for part in inside if ":" in part]
            begin = self.plain.index("{", found.end() + sum(map(len, inside)))
            self.functions[found[1]] = Function(found[1], parameters, begin, self.closing(begin))

    def closing(self, begin):
        depth = 0
        for k in range(begin, len(self.plain)):
            depth += (self.plain[k] == "{") - (self.plain[k] == "}")
            if depth == 0:
                return k
        raise Failure("a brace is not closed")

    def calls(self, function):
        """The functions that a function calls, with the place of the parenthesis."""
        body = self.plain[function.begin : function.end]
        found = ((m[1], function.begin + m.end() - 1) for m in re.finditer(r"\b(\w+)\(", body))
        return [(self.functions[name], at) for name, at in found if name in self.functions]

    def reachable(self, entry):
        """The functions that the entry reaches, callers first."""
        order = []

        def visit(function):
            if function not in order:
                for called, _ in self.calls(function):
                    visit(called)
                order.append(function)

        visit(self.functions[entry])
        return order[::-1]

    def line(self, at):
        begin = self.text.rfind("\n", 0, at) + 1
        return self.text[begin : self.text.find("\n", at)].split("//")[0].strip()


class Names:
    """The values known in the functions of a kernel, for one set of parameters."""

    def __init__(self, text, order, entry, parameters):
        self.uniform, self.thread = {}, {}
        if missing := {value for value in parameters.values() if isinstance(value, str)} - set(text.constants):
            raise Failure(f"solve.py names constants that the shaders do not have: {', '.join(sorted(missing))}")
        values = {name: text.constants[v] if isinstance(v, str) else v for name, v in parameters.items()}
        known = text.constants | values
        passed = {function.name: None for function in order}
        for function in order:
            uniform, thread = dict(known), dict(known)
            for n, (name, is_thread) in enumerate(function.parameters):
                if function.name == entry:
                    if is_thread:
                        thread[name] = 0
                    continue
                for names, kind in ((uniform, 0), (thread, 1)):
                    values = {call[kind][n] for call in passed[function.name] or []}
                    if len(values) == 1 and None not in values:
                        names[name] = values.pop()
            body = text.plain[function.begin : function.end]
            lets = re.findall(r"\blet (\w+)(?:: \w+)? = ([^;]+);", body)
            for name, value in lets:
                for names in (uniform, thread):
                    names.pop(name, None)
                    try:
                        # A name that is given twice may have either value.
                        if sum(name == other for other, _ in lets) == 1:
                            names[name] = evaluate(value, names)
                    except Unknown:
                        pass
            for name in re.findall(r"\bvar (\w+)\b", body):
                uniform.pop(name, None)
                thread.pop(name, None)
            self.uniform[function.name], self.thread[function.name] = uniform, thread
            for called, at in text.calls(function):
                values = [self._values(arguments(text.plain, at), names) for names in (uniform, thread)]
                passed[called.name] = (passed[called.name] or []) + [values]

    @staticmethod
    def _values(parts, names):
        values = []
        for part in parts:
            try:
                values.append(evaluate(part, names))
            except Unknown:
                values.append(None)
        return values


def marked(source, entry, sets):
    """Places and marks: those of loops and of regions that do not run exactly once. `sets` has the sets of parameters
    for which counts are wanted."""
    text = Text(source)
    order = text.reachable(entry)
    known = [Names(text, order, entry, parameters) for parameters in sets.values()]
    marks, inserted, missing, kept = [], [], [], []

    def mark(at, kind, counts, warps=1):
        marks.append(Mark(kind, text.line(at), counts, warps))
        inserted.append((at, len(marks) - 1))
        if len(marks) > MARKS:
            raise Failure("too many marks")

    def told(directive, function, loops, words):
        """The counts that a directive's words say."""
        try:
            return [evaluate(words, names.thread[function.name] | loops) for names in known]
        except Unknown as error:
            raise Failure(f"not understood: {directive[0]}") from error

    def region(begin, end, counts, warps, function, loops):
        """Marks what lies between two places, if it does not run exactly once, and what is in it."""
        begun = None
        if warps > 1 or any(count != 1 for count in counts):
            begun = len(marks)
            mark(begin, "region", counts, warps)
            if text.plain[begin - 2 : begin].strip() == "}":
                following = begin + len(text.plain[begin:]) - len(text.plain[begin:].lstrip())
                marks[begun].where = f"(rest) {text.line(following)}"
        walk(function, begin, end, loops)
        if begun is not None:
            mark(end_of_block(begin, end), "end", [begun])

    def end_of_block(begin, end):
        """Place of the mark of a block's end: before a jump. A value that it returns takes time, so it is kept."""
        last = JUMP.search(text.plain[begin:end])
        if not last:
            return end
        first, after = begin + last.start(), begin + last.end(1)
        if not re.match(r"return\b.*\(", last[1], re.DOTALL):
            return first
        if after not in kept:
            kept.append(after)
            inserted.append((first, KEEP))
        return after

    def walk(function, begin, end, loops):
        """Marks the statements between two places."""
        k = start = begin
        depth, before, jumps = 0, None, True
        while k < end:
            c = text.plain[k]
            depth += (c in "([") - (c in ")]")
            if c == "{":
                header, close = text.plain[start:k].strip(), text.closing(k)
                jumps = (jumps or header.startswith("if")) and bool(JUMP.search(text.plain[k:close]))
                before = block(function, header, k, close, loops, before)
                k = start = close + 1
                if jumps and before and min(before) < 1 and not text.plain[k:].lstrip().startswith("else"):
                    # What follows is left out where the `if` was taken.
                    if text.plain[k:end].strip():
                        region(k, end, before, 1, function, loops)
                    return
                continue
            if c == ";" and depth == 0:
                directive = text.directives.get(k + 1)
                if directive and directive[2]:
                    first = start + len(text.plain[start:k]) - len(text.plain[start:k].lstrip())
                    begun = len(marks)
                    mark(
                        first,
                        "region",
                        told(directive, function, loops, directive[2]),
                        int(directive[4] or 1),
                    )
                    mark(k + 1, "end", [begun])
                start, before = k + 1, None
            k += 1

    def block(function, header, begin, end, loops, before):
        """Marks a block. Returns, for an `if`, how often what follows it as `else` runs."""
        directive, word = text.directives.get(begin + 1), re.match(r"\w*", header)[0]
        if word in LOOPS:
            inner, warps = loops, 1
            if directive:
                counts, warps = (
                    told(directive, function, loops, directive[2]),
                    int(directive[4] or 1),
                )
            else:
                counts = []
                for names in known:
                    try:
                        count, first = runs(header, names.thread[function.name] | loops)
                    except Unknown:
                        missing.append(text.line(begin))
                        break
                    counts.append(count)
                    inner = loops | first
            mark(begin + 1, "loop", counts, warps)
            walk(function, begin + 1, end, inner)
            return None
        if word not in ("if", "else"):
            if directive:
                raise Failure(f"neither a loop nor an if: {text.line(begin)}")
            walk(function, begin + 1, end, loops)
            return None
        condition = header.split("if", 1)[1] if "if" in header else "true"
        counts, otherwise, warps = [], [], 1
        for n, names in enumerate(known):
            count = before[n] if word == "else" and before else 1
            try:
                value = bool(evaluate(condition, names.uniform[function.name]))
                counts.append(count * value)
                otherwise.append(count * (not value))
            except Unknown:
                # Its threads may differ: a warp goes both ways.
                counts.append(count)
                otherwise.append(count)
        if directive:
            counts, warps = (
                told(directive, function, loops, directive[2]),
                int(directive[4] or 1),
            )
            if directive[3]:
                otherwise = told(directive, function, loops, directive[3])
            else:
                otherwise = [max(0, 1 - count) if warps == 1 else 1 for count in counts]
        region(begin + 1, end, counts, warps, function, loops)
        return otherwise

    for function in order:
        walk(function, function.begin + 1, function.end, {})
        for at, directive in text.directives.items():
            if function.begin < at < function.end and directive[1]:
                mark(text.plain.index("\n", at) + 1, "near", [])
    if missing:
        raise Failure("these loops need a comment `// model: N times`:\n    " + "\n    ".join(missing))
    inserted += [(after, " return model_value;") for after in kept]
    return sorted(inserted, key=lambda pair: pair[0]), marks


def with_marks(source, places, chosen=None):
    """The text with marks: with all of them, or with the chosen ones."""
    out, last = [], 0
    for at, what in places:
        out.append(source[last:at])
        last = at
        if what == KEEP:
            last += len("return")
        if isinstance(what, str):
            out.append(what)
        elif chosen is None or what in chosen:
            out.append(f" _ = atomicExchange(&model_marks[{what}], {MAGIC + what}u); ")
    size = 1 + max((what for _, what in places if isinstance(what, int)), default=0)
    return "".join(
        [
            *out,
            source[last:],
            f"\nvar<workgroup> model_marks: array<atomic<u32>, {size}>;\n",
        ]
    )


def groups(marks):
    """Marks that belong together: those of a loop; the beginning and the end of a region."""
    ends = {mark.counts[0]: n for n, mark in enumerate(marks) if mark.kind == "end"}
    return [{n, ends[n]} if n in ends else {n} for n, mark in enumerate(marks) if mark.kind != "end"]
