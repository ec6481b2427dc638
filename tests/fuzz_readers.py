"""Mutated files through every reader: python tests/fuzz_readers.py COUNT [SEED].

Each must give an image or one line that names the file, within seconds and within the memory limit; a crash
of the library below ends this process, which is why the test runs it as one of its own. Prints a summary as
JSON.
"""

from __future__ import annotations

import json
import resource
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np
import tifffile
from PIL import Image

from embedded_files import CR3, RAF
from fsid.errors import FsidError
from fsid.sensor import Raw, load_profile, read_raw, write_dng
from fsid.sensor.bare import read_dn
from fsid.sensor.dng import read_header
from fsid.sensor.embedded import embedded_directories

MEMORY_LIMIT = 3 << 30
EXTREMES = (0, 1, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF)


def seeds(folder: Path) -> list[Path]:
    """Small healthy files of every kind that FSID reads."""
    rng, profile = np.random.default_rng(0), load_profile("pixel6")
    raw = Raw(
        rng.random((32, 48), np.float32), "GBRG", 64, 1023, (2, 1, 1.5), np.eye(3), "Maker Model", 800.0,
        profile.level(800),
    )  # fmt: skip
    preview = rng.integers(0, 255, (16, 24, 3)).astype(np.uint8)
    dn = rng.integers(0, 1024, (32, 48)).astype(np.uint16)
    write_dng(folder / "a.dng", raw)
    write_dng(folder / "b.dng", raw, preview)
    Image.fromarray(dn).save(folder / "c.png")
    tifffile.imwrite(folder / "d.tif", dn)
    tifffile.imwrite(folder / "e.tif", dn, compression="zlib", predictor=True)
    np.save(folder / "f.npy", dn)
    dn.tofile(folder / "g.raw")
    (folder / "h.cr3").write_bytes(CR3)
    (folder / "i.raf").write_bytes(RAF)
    return sorted(folder.iterdir())


def mutated(rng: np.random.Generator, data: bytes) -> bytes:
    """Bytes replaced, mostly in headers; numbers made extreme; parts cut, zeroed, doubled."""
    out = bytearray(data)
    for _ in range(int(rng.integers(1, 5))):
        reach = len(out) if rng.random() < 0.3 else min(len(out), 1024)
        at = int(rng.integers(max(reach - 8, 1)))
        kind = rng.integers(5)
        if kind == 0:
            out[at] = int(rng.integers(256))
        elif kind == 1:
            size = int(rng.choice((2, 4)))
            value = int(rng.choice(EXTREMES)) & (256**size - 1)
            out[at : at + size] = value.to_bytes(size, str(rng.choice(("little", "big"))))
        elif kind == 2:
            del out[int(rng.integers(1, len(out) + 1)) :]
        elif kind == 3:
            length = int(rng.integers(1, 64))
            out[at : at + length] = bytes(length)
        else:
            length = int(rng.integers(1, 64))
            out[at:at] = out[at : at + length]
        if len(out) < 10:
            break
    return bytes(out)


def read(path: Path) -> None:
    if path.suffix == ".dng":
        read_header(path)
        if not np.all(np.isfinite(read_raw(path).mosaic)):
            raise AssertionError("an image that is not finite")
    elif path.suffix in (".cr3", ".raf"):
        with path.open("rb") as file:
            embedded_directories(file)
        read_header(path)
    else:
        read_dn(path, cfa="RGGB", width=48, height=32)


def main(count: int, seed: int) -> int:
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_LIMIT, MEMORY_LIMIT))
    rng = np.random.default_rng(seed)
    found: Counter[str] = Counter()
    faults, slowest = [], 0.0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "seeds").mkdir()
        originals = [(path.suffix, path.read_bytes()) for path in seeds(folder / "seeds")]
        for number in range(count):
            suffix, data = originals[number % len(originals)]
            path = folder / f"fuzz{suffix}"
            path.write_bytes(mutated(rng, data))
            started = time.perf_counter()
            try:
                read(path)
                found["read"] += 1
            except FsidError as error:
                found["refused"] += 1
                if "\n" in str(error) or path.name not in str(error):
                    faults.append(f"{number}: not one line with the name: {str(error)[:200]!r}")
            except Exception as error:
                faults.append(f"{number} {suffix}: {type(error).__name__}: {str(error)[:200]}")
            slowest = max(slowest, time.perf_counter() - started)
    status = Path("/proc/self/status").read_text()  # getrusage would count the process that started this one
    peak_mb = int(status.split("VmHWM:")[1].split()[0]) // 1024
    print(json.dumps({**found, "faults": faults[:20], "slowest_s": round(slowest, 3), "peak_mb": peak_mb}))
    return len(faults)


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 0) > 0)
