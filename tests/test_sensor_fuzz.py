"""No mutated file crashes, hangs or blows up a reader. FSID_FUZZ_FILES=10000 runs the full number."""

import json
import os
import subprocess
import sys
from pathlib import Path

COUNT = int(os.environ.get("FSID_FUZZ_FILES", "700"))
MEMORY_MB = 1500  # interpreter and libraries included
SLOWEST_S = 10.0  # on a machine that does other things too


def test_mutated_files_end_with_an_image_or_one_line():
    script = Path(__file__).with_name("fuzz_readers.py")
    run = subprocess.run([sys.executable, script, str(COUNT)], capture_output=True, timeout=60 + COUNT / 10)
    assert run.stdout, f"the reader crashed: {run.returncode} {run.stderr[-500:]!r}"
    found = json.loads(run.stdout)
    assert found["faults"] == []
    assert found["read"] + found["refused"] == COUNT
    assert found["read"] > COUNT / 20
    assert found["refused"] > COUNT / 20
    assert found["slowest_s"] < SLOWEST_S
    assert found["peak_mb"] < MEMORY_MB
