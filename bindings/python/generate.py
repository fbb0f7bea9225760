"""Writes what the package knows of the C API, from the C header.

    python generate.py

`_abi.py` gets the constants, the layouts of all structs and the signatures of all functions, for ctypes; `_records.py`
gets a dataclass for each struct that the library fills, with the header's comments as its documentation, and a Literal
of the names of each kind of constant. Nothing about the C API is written by hand: a new field in the header appears
here by itself.

The header is plain C without conditions that matter here, so no preprocessor is needed: comments and directives are
cut out, and pycparser reads the rest.
"""

import re
import textwrap
from pathlib import Path

from pycparser import c_ast, c_parser

HERE = Path(__file__).resolve().parent
HEADER = HERE.parents[1] / "include" / "vrtm.h"

# The C types of the header in ctypes.
INTEGERS = [f"{sign}int{bits}_t" for bits in (8, 16, 32, 64) for sign in ("", "u")]
SCALARS = {name: f"c_{name.removesuffix('_t')}" for name in (*INTEGERS, "float", "double", "char")} | {
    "size_t": "c_size_t"
}

# The structs that become dataclasses, and their names.
RECORDS = {
    "vrtm_strain": "Strain",
    "vrtm_worst_feature": "WorstFeature",
    "vrtm_device_info": "DeviceInfo",
    "vrtm_adapter_info": "Adapter",
    "vrtm_asset_info": "AssetInfo",
    "vrtm_tile_info": "TileInfo",
    "vrtm_tile_settings": "TileSettings",
    "vrtm_tile_estimate": "TileEstimate",
    "vrtm_map_info": "MapInfo",
    "vrtm_pbd_settings": "PbdSettings",
    "vrtm_tile_report": "TileReport",
    "vrtm_asset_report": "AssetReport",
    "vrtm_refinement_info": "RefinementInfo",
    "vrtm_carrier_info": "CarrierInfo",
}

# Records that are shown as tables.
TABLES = {name for name in RECORDS if name.endswith("report")}

# Structs of which the caller sets fields: all of these have a default.
SETTINGS = {"vrtm_tile_settings", "vrtm_pbd_settings", "vrtm_solve_options"}

TILE = "vrtm_tile_settings"

# Structs that are keyword arguments, as a TypedDict for type checkers, each with the fields that Python has otherwise.
KEYWORDS = {
    "TileSettingsFields": ("vrtm_tile_settings", set()),
    "SolveFields": ("vrtm_solve_options", {"release", "tile_count", "dirty_vertex_count", "progress"}),
}

# Fields that say nothing to Python.
HIDDEN = {"struct_size", "reserved"}

# Integers that are true or false.
FLAGS = {
    "software",
    "has_uuid",
    "has_luid",
    "truncated",
    "measured",
    "kept",
    "reached",
    "warm",
    "measure",
    "replace",
    "at_border",
}


class Header:
    """The declarations of the header, in its order."""

    def __init__(self, text: str) -> None:
        self.constants = dict(re.findall(r"^#define (VRTM_\w+) (.+)$", text, re.M))
        for guard in ("VRTM_H", "VRTM_API"):
            self.constants.pop(guard, None)
        self.field_docs = _field_docs(text)
        self.defaults = _defaults(text)
        self.typedefs: dict[str, c_ast.Node] = {}
        self.structs: dict[str, list[c_ast.Decl]] = {}
        self.functions: dict[str, c_ast.FuncDecl] = {}
        for node in c_parser.CParser().parse(_plain(text)).ext:
            if isinstance(node, c_ast.Typedef):
                if node.name in SCALARS:
                    continue
                kind = node.type.type if isinstance(node.type, c_ast.TypeDecl) else None
                if isinstance(kind, c_ast.Struct):
                    self.structs[node.name] = kind.decls
                else:
                    self.typedefs[node.name] = node.type
            elif isinstance(node, c_ast.Decl) and isinstance(node.type, c_ast.FuncDecl):
                self.functions[node.name] = node.type
        # What Python calls the constants: "VRTM_QUALITY_DRAFT" is 'draft'.
        self.names = {p + n.upper(): n for typedef in self.typedefs for p, n in self._prefixed(typedef)}
        _check_known(self)

    def scalar(self, name: str) -> str | None:
        """The ctypes name of a number's type; None for a struct."""
        while name in self.typedefs:
            node = self.typedefs[name]
            if not isinstance(node, c_ast.TypeDecl):
                return name
            name = node.type.names[0]
        return SCALARS.get(name)

    def type(self, node: c_ast.Node) -> str:
        """A type as an expression of ctypes. Pointers to numbers are plain addresses."""
        if isinstance(node, c_ast.PtrDecl):
            inner = node.type
            if isinstance(inner, c_ast.FuncDecl):
                return self.signature(inner, "CFUNCTYPE({})")
            if isinstance(inner, c_ast.PtrDecl):
                return "c_void_p"
            # A struct that is defined further down stands there as `struct name`.
            name = inner.type.name if isinstance(inner.type, c_ast.Struct) else inner.type.names[0]
            if name in self.structs:
                return f"POINTER({name})"
            return "c_char_p" if name == "char" else "c_void_p"
        if isinstance(node, c_ast.ArrayDecl):
            return f"{self.type(node.type)} * {node.dim.value}"
        name = node.type.names[0]
        if name == "void":
            return "None"
        return self.scalar(name) or name

    def in_order_of_use(self) -> list[str]:
        """The names of all structs: one stands after those that it holds or points to."""
        order: list[str] = []

        def add(name: str) -> None:
            for field in self.structs[name]:
                for used in re.findall(r"\w+", self.type(field.type)):
                    if used in self.structs and used not in order:
                        add(used)
            order.append(name)

        for name in self.structs:
            if name not in order:
                add(name)
        return order

    def signature(self, node: c_ast.FuncDecl, form: str) -> str:
        """A function's result and then its arguments, within `form`."""
        types = [self.type(p.type) for p in node.args.params] if node.args else []
        # Structs are defined below the functions of a host, which get addresses of them.
        pointer = "c_void_p" if form.startswith("CFUNCTYPE") else None
        types = [(pointer or kind) if kind.startswith("POINTER") else kind for kind in types if kind != "None"]
        return form.format(", ".join([self.type(node.type), *types]))

    def _prefixed(self, typedef: str) -> list[tuple[str, str]]:
        """The prefix and the name of each constant of a type such as vrtm_quality: ("VRTM_QUALITY_", "normal"), ..."""
        words = typedef.removeprefix("vrtm_").upper()
        for prefix in (f"VRTM_{words}_", f"VRTM_{words.split('_')[0]}_"):
            found = [name for name in self.constants if name.startswith(prefix)]
            if found:
                return [(prefix, name.removeprefix(prefix).lower()) for name in found]
        return []

    def values(self, typedef: str) -> dict[str, int]:
        """The named values of a type such as vrtm_quality: {"normal": 0, ...}."""
        return {name: int(self.constants[prefix + name.upper()]) for prefix, name in self._prefixed(typedef)}


def _plain(text: str) -> str:
    """The header's declarations alone, as pycparser reads them."""
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.S)
    text = re.sub(r"//[^\n]*", "", text)
    text = re.sub(r"^#(?:[^\n]*\\\n)*[^\n]*$", "", text, flags=re.M)
    text = re.sub(r"^VRTM_DEFINE_INIT_\w*\([^)]*\)|^extern \"C\" \{$|^\}\s*$|\bVRTM_API\b", "", text, flags=re.M)
    return "".join(f"typedef int {name};\n" for name in SCALARS if name.endswith("_t")) + text


def _defaults(text: str) -> dict[str, dict[str, float]]:
    """Values of the _init() functions: {"vrtm_solve_options": {"pbd.iterations": 16, ...}, ...}. All else is zero."""
    found = {}
    for struct, body in re.findall(r"^VRTM_DEFINE_INIT_WITH_\((\w+),\n([^)]*)\)", text, re.M):
        values = re.findall(r"value\.([\w.]+) = ([^;]+);", body)
        found[struct] = {field: _number(value) for field, value in values}
    return found


def _number(text: str) -> float:
    """A constant of C: 16, 0.02f, 1.0 / 2048."""
    number, _, divisor = text.rstrip("f").partition("/")
    value = float(number) / float(divisor or 1)
    return int(value) if re.fullmatch(r"\d+", text) else value


def _field_docs(text: str) -> dict[tuple[str, str], str]:
    """The comment over each struct ("vrtm_array", "") and over each of its fields ("vrtm_array", "data")."""
    docs: dict[tuple[str, str], str] = {}
    struct, comment = "", []
    for line in text.splitlines():
        stripped = line.strip()
        if stripped.startswith("// "):
            comment.append(stripped[3:])
            continue
        if match := re.match(r"typedef struct (\w+) \{", stripped):
            struct = match[1]
            docs[struct, ""] = " ".join(comment)
        elif struct and (match := re.search(r"(\w+)(?:\[\d+\])?;$", stripped)):
            docs[struct, match[1]] = " ".join(comment)
        if stripped.startswith("}"):
            struct = ""
        comment = []
    return docs


def _check_known(header: Header) -> None:
    """Ends the program if a table above names something that is not in the header."""
    named = {*RECORDS, *SETTINGS}
    fields = {field.name for struct in named for field in header.structs.get(struct, [])}
    if unknown := (named - set(header.structs)) | (FLAGS - fields):
        raise SystemExit(f"generate.py: not in the header: {sorted(unknown)}")


def abi(header: Header) -> str:
    """The text of _abi.py."""
    used = sorted({*SCALARS.values(), "c_char_p", "c_void_p", "CFUNCTYPE", "POINTER", "Structure"})
    lines = ['"""The C API for ctypes: written by generate.py from vrtm.h; do not edit."""', ""]
    lines += ["from ctypes import (", *(f"    {name}," for name in used), ")", ""]
    lines += [f"{name} = {value.replace('UINT32_MAX', '0xFFFFFFFF')}" for name, value in header.constants.items()]
    for name, node in header.typedefs.items():
        if isinstance(node, c_ast.PtrDecl):
            lines += [f"{name} = {header.type(node)}"]
        elif values := header.values(name):
            lines += [f"{name}_values = {values!r}"]
    for name in header.in_order_of_use():
        decls = header.structs[name]
        fields = [f'        ("{d.name}", {header.type(d.type)}),' for d in decls]
        lines += ["", "", f"class {name}(Structure):", "    _fields_ = [", *fields, "    ]"]
    lines += ["", "", "# Result and arguments of each function."]
    lines += ["functions: dict[str, list] = {"]
    lines += [f'    "{name}": {header.signature(node, "[{}]")},' for name, node in header.functions.items()]
    lines += ["}", ""]
    return "\n".join(lines)


def records(header: Header) -> str:
    """The text of _records.py."""
    lines = [
        '"""Structs of the C API as dataclasses: written by generate.py from vrtm.h; do not edit."""',
        "",
        "from __future__ import annotations",
        "",
        "from dataclasses import dataclass",
        "from typing import Literal, TypedDict",
        "",
        "from ._table import Table, refuse",
        "",
    ]
    for typedef, node in header.typedefs.items():
        values = header.values(typedef)
        if values and not isinstance(node, c_ast.PtrDecl):
            lines += [f"{_literal(typedef)} = Literal[{', '.join(map(repr, values))}]"]
    # A record stands after those that it holds.
    for struct, name in RECORDS.items():
        lines += ["", "", f"@dataclass(frozen=True{', repr=False' * (struct in TABLES)})"]
        lines += [
            f"class {name}(Table):" if struct in TABLES else f"class {name}:",
            *_doc(header, header.field_docs[struct, ""]),
        ]
        for decl in header.structs[struct]:
            if decl.name in HIDDEN:
                continue
            lines += ["", f"    {decl.name}: {_hint(header, struct, decl)}"]
            lines += _doc(header, header.field_docs[struct, decl.name])
    for name, (struct, others) in KEYWORDS.items():
        lines += ["", "", f"class {name}(TypedDict, total=False):"]
        for decl in header.structs[struct]:
            if decl.name in others | HIDDEN or isinstance(decl.type, c_ast.PtrDecl):
                continue
            lines += [f"    {decl.name}: {_hint(header, struct, decl).partition(' = ')[0]}"]
            lines += _doc(header, header.field_docs[struct, decl.name])
    about = {d.name: _words(header, header.field_docs[TILE, d.name]) for d in header.structs[TILE][1:]}
    lines += ["", "", "# What the settings of a tile are for.", f"about_settings = {about!r}"]
    lines += ["", "", "# Which struct each of them is in the header."]
    lines += ["structs = {", *(f'    {name}: "{struct}",' for struct, name in RECORDS.items()), "}"]
    lines += ["", "for kind in structs:", '    setattr(kind, "__setattr__", refuse)', ""]
    return "\n".join(lines)


def _hint(header: Header, struct: str, decl: c_ast.Decl) -> str:
    if isinstance(decl.type, c_ast.ArrayDecl):
        return "str" if decl.type.type.type.names[0] == "char" else "bytes"
    name = decl.type.type.names[0]
    if name in RECORDS:
        return RECORDS[name]
    if name in header.typedefs and header.values(name):
        # Its first value is zero, the default. A record may have a name that only a newer library knows.
        return f'{_literal(name)} = "{next(iter(header.values(name)))}"' if struct in SETTINGS else "str"
    if decl.name in FLAGS:
        return "bool"
    kind = "float" if header.scalar(name) in ("c_float", "c_double") else "int"
    return f"{kind} = {_default(header, struct, decl.name)}" if struct in SETTINGS else kind


def _literal(typedef: str) -> str:
    """Name in Python of a kind of constant: FetchKind for vrtm_fetch_kind."""
    return typedef.removeprefix("vrtm_").title().replace("_", "")


def _default(header: Header, struct: str, field: str) -> float:
    """Value that the _init() function of the struct sets, or of the one that holds it."""
    if struct == "vrtm_pbd_settings":
        struct, field = "vrtm_solve_options", f"pbd.{field}"
    return header.defaults[struct].get(field, 0)


def _words(header: Header, text: str) -> str:
    """A comment of the header with the names that its constants have in Python."""
    text = re.sub(r" ?Start from vrtm_\w+\(\)[^.]*\.", "", text)
    for constant, name in header.names.items():
        text = re.sub(rf"\b{constant}\b", f"'{name}'", text)
    return text.strip()


def _doc(header: Header, text: str) -> list[str]:
    """A comment of the header as the documentation of a class or a field."""
    text = _words(header, text).replace("\\", "\\\\")
    return textwrap.wrap(f'"""{text}"""', 120, initial_indent="    ", subsequent_indent="    ")


def generate(header: Path, out: Path) -> None:
    """Writes both files into the folder `out`."""
    parsed = Header(header.read_text(encoding="utf-8"))
    texts = {out / "_abi.py": abi(parsed), out / "_records.py": records(parsed)}
    for path, text in texts.items():
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8", newline="\n")


if __name__ == "__main__":
    generate(HEADER, HERE / "src" / "vrtm")
