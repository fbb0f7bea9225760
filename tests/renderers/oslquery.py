"""Stands in for the module `oslquery` of Open Shading Language, which Blender has and its Python module has not.

Blender asks it for a compiled shader's parameters, to give the Script node its sockets. It is found because this folder
is on the path; of the file format (.oso, text) it reads the lines of parameters that are numbers, vectors and strings.
"""

import shlex


class _Kind:
    """A value that knows the names of all values, as those of oslquery do."""

    NOSEMANTICS, COLOR, POINT, VECTOR, NORMAL, SCALAR, VEC3, INT, FLOAT, STRING = range(10)

    def __init__(self, value):
        self.value = value

    def __eq__(self, other):
        return self.value == other

    __hash__ = None


class _Type:
    arraylen = 0

    def __init__(self, name):
        vector = name in ("color", "point", "vector", "normal")
        self.vecsemantics = _Kind(getattr(_Kind, name.upper()) if vector else _Kind.NOSEMANTICS)
        self.aggregate = _Kind(_Kind.VEC3 if vector else _Kind.SCALAR)
        self.basetype = _Kind(_Kind.FLOAT if vector else getattr(_Kind, name.upper()))


class _Parameter:
    isclosure = isstruct = varlenarray = False
    metadata = ()

    def __init__(self, output, kind, name, words):
        self.isoutput, self.name, self.type = output, name, _Type(kind)
        values = [word if kind == "string" else float(word) for word in words]
        self.value = values[0] if len(values) == 1 else tuple(values) or None


class OSLQuery:
    def __init__(self, path):
        self.parameters = []
        with open(path) as file:
            for line in file:
                head, *words = shlex.split(line.split("%")[0]) or [""]
                if head in ("param", "oparam") and words[0] in ("int", "float", "string", "color", "point", "vector",
                                                                "normal"):
                    self.parameters.append(_Parameter(head == "oparam", words[0], words[1], words[2:]))
