"""Modules generated from the header agree with a C compiler."""

import ctypes
import os
import shutil
import subprocess
import sys
import typing
from pathlib import Path

import pytest

import vrtm
from vrtm import _abi, _names, _records
from vrtm._arrays import Pixels

HEADER = Path(__file__).resolve().parents[3] / "include" / "vrtm.h"


def structs():
    return {kind.__name__: kind for kind in ctypes.Structure.__subclasses__() if kind.__module__ == "vrtm._abi"}


def test_layouts_are_those_of_a_compiler(tmp_path):
    """Sizes, and offsets of all fields, as a C compiler has them."""
    compiler = os.environ.get("CC") or shutil.which("cc")
    if not compiler:
        pytest.skip("no C compiler")
    lines = ["#include <stdio.h>", f'#include "{HEADER}"', "int main(void) {"]
    expected = []
    for name, struct in structs().items():
        lines.append(f'printf("%zu\\n", sizeof({name}));')
        expected.append(ctypes.sizeof(struct))
        for field, *_ in struct._fields_:
            lines.append(f'printf("%zu\\n", offsetof({name}, {field}));')
            expected.append(getattr(struct, field).offset)
    assert len(expected) > 200
    source = tmp_path / "layout.c"
    source.write_text("\n".join([*lines, "return 0; }"]))
    subprocess.run([compiler, str(source), "-o", str(tmp_path / "layout")], check=True)
    found = subprocess.run([tmp_path / "layout"], capture_output=True, text=True, check=True).stdout.split()
    assert [int(n) for n in found] == expected


def test_the_library_knows_the_defaults_of_every_struct():
    """They are those of the header's initialisers, which set few fields besides the size."""
    initialised = HEADER.read_text().split("Initialisers")[1]
    sized = {name: struct for name, struct in structs().items() if struct._fields_[0][0] == "struct_size"}
    # Only the library makes entries of the log.
    del sized["vrtm_log_entry"]
    assert len(sized) > 20
    for name, struct in sized.items():
        value = vrtm._library.new(struct)
        assert value.struct_size == ctypes.sizeof(struct)
        set_there = initialised.split(f"({name}")[1].split("VRTM_DEFINE")[0].count("value.")
        bytes_set = bytes(value)[4:]
        assert (set_there > 0) == any(bytes_set), name
    larger = ctypes.create_string_buffer(64)
    with pytest.raises(vrtm.InvalidArgumentError, match="there is no struct"):
        vrtm._library.check(vrtm._library.library.vrtm_defaults(b"vrtm_strain", larger, 64))
    with pytest.raises(vrtm.InvalidArgumentError, match="size is 8"):
        vrtm._library.check(vrtm._library.library.vrtm_defaults(b"vrtm_array", larger, 8))


def test_records_have_all_fields():
    """Each dataclass has what its struct has, and each field is described."""
    for cls, struct in _records.structs.items():
        fields = [n for n, *_ in getattr(_abi, struct)._fields_ if n not in ("struct_size", "reserved")]
        assert list(cls.__annotations__) == fields
    assert len(_records.structs) == 14


def test_every_function_has_a_caller():
    """No function of the library is out of Python's reach."""
    package = Path(vrtm.__file__).parent
    text = "".join(p.read_text() for p in package.glob("*.py") if p.name != "_abi.py")
    # Said otherwise: by one that does the same and more.
    covered = {"vrtm_asset_solve": "vrtm_asset_redirect"}
    missing = [name for name in _abi.functions if f"library.{covered.get(name, name)}" not in text]
    assert not missing


def test_names():
    assert vrtm.version().count(".") == 2 and vrtm.library_path().is_file()
    described = [name for name in vrtm.__all__ if typing.get_origin(getattr(vrtm, name)) is not typing.Literal]
    assert all(getattr(vrtm, name).__doc__ for name in described)


def test_hints_of_names_are_what_the_library_takes():
    """Each parameter and setting that is a name has a Literal, of the names that are taken there."""
    places = [vrtm.Device.__init__, vrtm.Asset.__init__, vrtm.Fetch.__init__]
    places += [vrtm.SolveOptions, vrtm.TileSettings, _records.TileSettingsFields]
    places += [function for name, function in vars(vrtm.Tile).items() if callable(function) and name != "_set"]
    # Modules of the package import each other, so that some names are imported for type checkers alone.
    local, found = {"Asset": vrtm.Asset, "Tile": vrtm.Tile, "Unpack": typing.Unpack}, set()
    for place in places:
        for name, hint in typing.get_type_hints(place, None, local).items():
            assert hint is not str or name == "return", (place, name)
            if typing.get_origin(hint) is typing.Literal:
                argument = {"kind": "fetch_kind"}.get(name, name)
                assert set(typing.get_args(hint)) == set(_names.values(argument)), (place, name)
                found.add(name)
    named = {"backend", "kind", "open_borders", "origin", "overlap", "quality", "scale", "seams", "solver", "weld"}
    assert found == named
    # Outputs of tiles are arrays, and those of carriers are records.
    if sys.version_info >= (3, 11):
        outputs = [
            typing.get_type_hints(one, None, local)["return"] for one in typing.get_overloads(vrtm.Asset.redirect)
        ]
        assert outputs == [list[Pixels], list[vrtm.Carried], list[Pixels | vrtm.Carried]]
    assert set(typing.get_args(vrtm.LogLevel)) == set(_names.values("log_level"))
    assert set(typing.get_args(vrtm.LogCode)) == set(_names.values("log_code"))
