"""Runs the tests beside this folder in a whole Blender, without its window."""

import os
import signal
import sys

import pytest

TESTS = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))

# As a Python by itself does: tests limit the size of files, and look at the errors.
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
# What builds the archive needs the repository.
code = pytest.main(["-q", "-p", "no:cacheprovider", "--color=no", f"--ignore={TESTS}/test_build.py", TESTS])
print("ok suite" if code == 0 else "FAILED suite", flush=True)
sys.stderr.flush()
os._exit(int(code))
