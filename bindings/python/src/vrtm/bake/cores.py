"""How many frames at a time, and with how many threads each."""

from __future__ import annotations

import math
import os

from vrtm.bake.settings import Settings
from vrtm.bake.work import Work

_BYTES_PER_TEXEL = 100
"""Of the images of a tile, while one is made."""
_BYTES_PER_JOB = 300 << 20
"""Python and its modules, and the scene."""


def available() -> int:
    """The cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def split(settings: Settings, work: Work, tasks: int) -> tuple[int, int]:
    """(jobs, threads per job) for so many tasks. A GPU gets one job: frames would wait for one another there."""
    cores = available()
    # Frames that start from one another are baked one after the other.
    jobs = 1 if settings.warm else settings.jobs
    if jobs == 0:
        jobs = 1 if work.device.info.backend == "gpu" else min(cores, _fitting(work))
    jobs = max(1, min(jobs, tasks))
    threads = settings.threads or max(1, cores // jobs)
    return jobs, threads


def _fitting(work: Work) -> int:
    """As many as find room in the memory that is free."""
    tiles = [tile for mesh in work.meshes.values() for tile in mesh.tiles]
    # A size that follows from what the map holds is at most twice the grid's.
    images = max((math.prod(tile.size) or 4 * math.prod(tile.cells) for tile in tiles), default=0)
    free = _free()
    return max(1, free // (work.bytes + images * _BYTES_PER_TEXEL + _BYTES_PER_JOB)) if free else 1 << 16


def _free() -> int:
    """Bytes of memory that are free; 0 if the system does not tell."""
    try:
        with open("/proc/meminfo", encoding="ascii") as file:
            lines = dict(line.split(":", 1) for line in file)
        return int(lines["MemAvailable"].split()[0]) << 10
    except (OSError, KeyError, ValueError):
        return 0
