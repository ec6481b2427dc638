"""Peak memory of `fsid denoise` on a large file: python bench/denoise_memory.py [MEGAPIXELS] [CONFIG].

Writes a noisy DNG of 4:3 and runs the command on it in a process of its own, with untrained weights of the
configuration (nafnet-small by default): memory and time do not depend on them.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from fsid.denoise import ModelCard, RawDenoiser, save_model, train_config
from fsid.sensor import Raw, load_profile, write_dng


def main() -> None:
    megapixels = float(sys.argv[1]) if len(sys.argv) > 1 else 48.0
    config = train_config(sys.argv[2] if len(sys.argv) > 2 else "nafnet-small")
    height = round((megapixels * 1e6 * 3 / 4) ** 0.5 / 2) * 2
    profile = load_profile("pixel6")
    with tempfile.TemporaryDirectory() as folder:
        source, model = Path(folder) / "noisy.dng", Path(folder) / "model.safetensors"
        x = 0.2 + 0.05 * np.random.default_rng(0).standard_normal(
            (height, height * 4 // 3 // 2 * 2), np.float32
        )
        write_dng(
            source,
            Raw(
                x,
                profile.cfa,
                profile.black_level,
                profile.white_level,
                (2.0, 1.0, 1.5),
                np.eye(3),
                noise=profile.level(3200),
            ),
        )
        save_model(
            model, RawDenoiser(config.network).state_dict(), ModelCard(config.network, config.patch_px)
        )
        target = Path(folder) / "clean.dng"
        command = [sys.executable, "-m", "fsid", "denoise", str(source), str(target), "--model", str(model)]
        start = time.perf_counter()
        subprocess.run([*command, "--quiet"], check=True)
        seconds = time.perf_counter() - start
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    peak_gb, cpu_s = used.ru_maxrss / 1e6, used.ru_utime
    print(f"{x.size / 1e6:.1f} MP: peak {peak_gb:.2f} GB, {seconds:.0f} s, CPU {cpu_s:.0f} s")


if __name__ == "__main__":
    main()
