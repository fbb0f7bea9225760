"""A hash of everything that a file's content depends on, by which a later run tells whether the file is up to date."""

import hashlib

import numpy as np


class Fingerprint:
    """Collects what the content of an output depends on: not paths, threads or the time."""

    def __init__(self) -> None:
        self._hash = hashlib.blake2b(digest_size=16)

    def copy(self) -> "Fingerprint":
        other = Fingerprint()
        other._hash = self._hash.copy()
        return other

    def text(self, *parts: object) -> "Fingerprint":
        for part in parts:
            self._bytes(str(part).encode())
        return self

    def array(self, values: np.ndarray | None) -> "Fingerprint":
        """Adds an array with its shape and type."""
        if values is None:
            return self.text("none")
        self.text(values.dtype.newbyteorder("<").str, values.shape)
        packed = np.ascontiguousarray(values)
        self._bytes(packed.astype(packed.dtype.newbyteorder("<"), copy=False).data.cast("B") if packed.size else b"")
        return self

    def hex(self) -> str:
        """128 bits in hex."""
        return self._hash.hexdigest()

    def _bytes(self, data: bytes | memoryview) -> None:
        # With the length before them, so that no two lists of inputs run together to the same bytes.
        self._hash.update(len(data).to_bytes(8, "little"))
        self._hash.update(data)
