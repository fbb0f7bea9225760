"""Values of WGSL expressions of numbers and truth values, as far as the names in them are known."""

import ast
import re


class Unknown(Exception):
    """A value that depends on data."""


class Failure(Exception):
    """A count that the model cannot know and has to be told."""


def evaluate(text, names):
    """The value of a WGSL expression of numbers and truth values."""
    text = re.sub(r"\b(0x[0-9a-fA-F]+|\d+\.?\d*(?:e[+-]?\d+)?)[uif]?(?![\w.])", r"\1", text)
    text = text.replace("&&", " and ").replace("||", " or ")
    text = re.sub(r"!(?!=)", " not ", text)
    try:
        tree = ast.parse(" ".join(text.split()), mode="eval").body
    except SyntaxError as error:
        raise Unknown(text) from error
    return _value(tree, names)


def _either(node, names, decisive):
    """`and` (decisive: False) or `or` (True): one decisive value suffices."""
    unknown = False
    for part in node.values:
        try:
            if bool(_value(part, names)) == decisive:
                return decisive
        except Unknown:
            unknown = True
    if unknown:
        raise Unknown(ast.dump(node))
    return not decisive


def _divide(a, b):
    return a // b if isinstance(a, int) and isinstance(b, int) else a / b


OPERATORS = {
    ast.Add: lambda a, b: a + b, ast.Sub: lambda a, b: a - b, ast.Mult: lambda a, b: a * b, ast.Div: _divide,
    ast.Mod: lambda a, b: a % b, ast.BitAnd: lambda a, b: a & b, ast.BitOr: lambda a, b: a | b,
    ast.LShift: lambda a, b: a << b, ast.RShift: lambda a, b: a >> b, ast.Lt: lambda a, b: a < b,
    ast.LtE: lambda a, b: a <= b, ast.Gt: lambda a, b: a > b, ast.GtE: lambda a, b: a >= b,
    ast.Eq: lambda a, b: a == b, ast.NotEq: lambda a, b: a != b,
}  # fmt: skip
CALLS = {
    "min": min,
    "max": max,
    "u32": int,
    "i32": int,
    "f32": float,
    "select": lambda a, b, c: b if c else a,
}


def _value(node, names):
    match node:
        case ast.Constant(value=value):
            return value
        case ast.Name(id="true" | "false" as name):
            return name == "true"
        case ast.Name(id=name) if name in names:
            return names[name]
        case ast.Attribute(value=ast.Name(id=base), attr=name) if f"{base}.{name}" in names:
            return names[f"{base}.{name}"]
        case ast.BoolOp():
            return _either(node, names, isinstance(node.op, ast.Or))
        case ast.UnaryOp(op=ast.Not()):
            return not _value(node.operand, names)
        case ast.UnaryOp(op=ast.USub()):
            return -_value(node.operand, names)
        case ast.BinOp() if type(node.op) in OPERATORS:
            return OPERATORS[type(node.op)](_value(node.left, names), _value(node.right, names))
        case ast.Compare(ops=[operator]) if type(operator) in OPERATORS:
            return OPERATORS[type(operator)](_value(node.left, names), _value(node.comparators[0], names))
        case ast.Call(func=ast.Name(id=name), args=arguments) if name in CALLS:
            return CALLS[name](*(_value(argument, names) for argument in arguments))
    raise Unknown(ast.dump(node))


def runs(header, names):
    """Number of times that a loop's body runs, and its variable's first value, if it is a `for` over numbers."""
    found = re.match(r"for \(var (\w+)(?:: \w+)? = (.*?); (.*?); (.*)\)$", " ".join(header.split()))
    if not found:
        raise Unknown(header)
    name, first, condition, update = found.groups()
    step = re.match(rf"{name} ?(\+\+|--|[-+*/]=)\s*(.*)$", update)
    if not step:
        raise Unknown(header)
    names = dict(names)
    start = names[name] = evaluate(first, names)
    operator, count = (
        {"+": ast.Add, "-": ast.Sub, "*": ast.Mult, "/": ast.Div}[step[1][0]],
        0,
    )
    while evaluate(condition, names):
        count += 1
        names[name] = OPERATORS[operator](names[name], evaluate(step[2] or "1", names))
        if count > 100_000:
            raise Unknown(header)
    return count, {name: start}
