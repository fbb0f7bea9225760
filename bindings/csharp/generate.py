"""Writes Vrtm.cs, the C API for C#, from the C header.

    python generate.py OUT/Vrtm.cs

It has all constants, structs with the header's comments, their Init() functions, callbacks and functions, with names as
in C. The header is read by the Python package's generator.
"""

import sys
from pathlib import Path

from pycparser import c_ast

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "python"))
from generate import HEADER, Header  # noqa: E402

SCALARS = {
    "c_int8": "sbyte",
    "c_uint8": "byte",
    "c_int16": "short",
    "c_uint16": "ushort",
    "c_int32": "int",
    "c_uint32": "uint",
    "c_int64": "long",
    "c_uint64": "ulong",
    "c_size_t": "UIntPtr",
    "c_float": "float",
    "c_double": "double",
    "c_char": "byte",
}
# Names that C# has for itself.
KEYWORDS = {"fixed", "in", "out", "object", "params", "ref"}
HEAD = """\
// The C API of vrtm for C#: written by generate.py from vrtm.h; do not edit. Calls take pointers, as in C: Asset.cs
// wraps the most common ones.
using System;
using System.Runtime.InteropServices;

namespace Vrtm
{
    public static unsafe class Api
    {
        private const string Library = "vrtm";
"""


def word(name):
    """A name, also where it is a keyword of C#."""
    return f"@{name}" if name in KEYWORDS else name


def is_callback(header, name):
    return isinstance(header.typedefs.get(name), c_ast.PtrDecl)


def type_of(header, node):
    """A type of C in C#. Functions are addresses, which Marshal makes of delegates."""
    if isinstance(node, c_ast.PtrDecl):
        inner = node.type
        if isinstance(inner, c_ast.FuncDecl):
            return "IntPtr"
        if isinstance(inner, c_ast.PtrDecl):
            return "void**"
        name = inner.type.name if isinstance(inner.type, c_ast.Struct) else inner.type.names[0]
        return f"{name if name == 'void' or name in header.structs else SCALARS[header.scalar(name)]}*"
    name = node.type.names[0]
    if name == "void" or name in header.structs:
        return name
    return "IntPtr" if is_callback(header, name) else SCALARS[header.scalar(name)]


def parameters(header, function):
    named = [p for p in function.args.params if p.name] if function.args else []
    return ", ".join(f"{type_of(header, p.type)} {word(p.name)}" for p in named)


def comment(text, indent):
    text = text.replace("&", "&amp;").replace("<", "&lt;")
    return [f"{indent}/// <summary>{text}</summary>"] if text else []


def struct(header, name):
    lines = comment(header.field_docs[name, ""], " " * 8)
    lines += ["        [StructLayout(LayoutKind.Sequential)]", f"        public struct {name}", "        {"]
    for field in header.structs[name]:
        lines += comment(header.field_docs[name, field.name], " " * 12)
        if isinstance(field.type, c_ast.ArrayDecl):
            element = type_of(header, field.type.type)
            lines += [f"            public fixed {element} {word(field.name)}[{field.type.dim.value}];"]
        else:
            lines += [f"            public {type_of(header, field.type)} {word(field.name)};"]
    if header.structs[name][0].name == "struct_size":
        lines += [
            "",
            f"            /// <summary>As {name}_init() in C.</summary>",
            f"            public static {name} Init()",
            "            {",
            f"                var value = default({name});",
            f"                value.struct_size = (uint)sizeof({name});",
        ]
        for field, value in header.defaults.get(name, {}).items():
            decl = next(d for d in header.structs[name] if d.name == field.split(".")[0])
            if "." in field:
                decl = next(d for d in header.structs[decl.type.type.names[0]] if d.name == field.split(".")[1])
            suffix = "f" if type_of(header, decl.type) == "float" else ""
            lines += [f"                value.{field} = {value!r}{suffix};"]
        lines += ["                return value;", "            }"]
    return [*lines, "        }", ""]


def text(header):
    lines = [HEAD.rstrip("\n"), ""]
    for name, value in header.constants.items():
        kind = "uint" if "UINT32_MAX" in value else "int"
        lines += [f"        public const {kind} {name} = {value.replace('UINT32_MAX', 'uint.MaxValue')};"]
    lines += [""]
    for name in header.typedefs:
        if is_callback(header, name):
            function = header.typedefs[name].type
            result = type_of(header, function.type)
            lines += [
                "        [UnmanagedFunctionPointer(CallingConvention.Cdecl)]",
                f"        public delegate {result} {name}({parameters(header, function)});",
                "",
            ]
    for name in header.in_order_of_use():
        lines += struct(header, name)
    for name, function in header.functions.items():
        lines += [
            "        [DllImport(Library, CallingConvention = CallingConvention.Cdecl, ExactSpelling = true)]",
            f"        public static extern {type_of(header, function.type)} {name}({parameters(header, function)});",
            "",
        ]
    return "\n".join(lines).rstrip() + "\n    }\n}\n"


def main():
    if len(sys.argv) != 2:
        sys.exit("usage: generate.py OUT/Vrtm.cs")
    Path(sys.argv[1]).write_text(text(Header(HEADER.read_text("utf-8"))), "utf-8")


if __name__ == "__main__":
    main()
