"""Sample i = f(config, seed, i): one clean RAW, one noisy RAW, and the record of how they came about.

Frame i // pairs_per_frame gives pairs_per_frame samples, because a render is the expensive part. A sample
does not depend on which process makes it, in which order, or how many others there are. A frame that a check
refuses is drawn again as the next attempt; the record says how often and why, and is all that is needed to
make the sample again.
"""

from __future__ import annotations

import io
import json
import zlib
from typing import Any

import numpy as np
from PIL import Image

from fsid.config import from_plain
from fsid.dataset.attempt import Attempt, Sample, sample_key
from fsid.dataset.config import GenerateConfig
from fsid.dataset.png import to_uint8
from fsid.dataset.tasks import SceneRenderer
from fsid.errors import FsidError, check_kind, whole
from fsid.scene import scene_from_json
from fsid.sensor import Raw, clean_levels, develop, write_dng

ATTEMPTS = 8
_SAME_NOISE = 1e-6  # relative: a machine may round otherwise


def make_sample(config: GenerateConfig, seed: int, index: int, renderer: SceneRenderer | None) -> Sample:
    """Sample `index` of the dataset (`config`, `seed`), as `fsid generate` first draws it.

    One that the finished dataset drew again, because it looks like an earlier one, is what `remake` makes of
    its JSON.
    renderer: that of `rendering(config)`, whose settings are the configuration's; other ones make another
    picture. None where `config.images` names a folder of pictures. FsidError as in `make_frame`.
    """
    check_kind(config, GenerateConfig, "generate_config makes one of a file, a name or settings")
    index = whole(index, "index")
    if index < 0:
        raise FsidError(f"index {index}: must not be negative")
    frame, place = divmod(index, config.pairs_per_frame)
    return make_frame(config, seed, frame, renderer)[place]


def make_frame(
    config: GenerateConfig,
    seed: int,
    frame: int,
    renderer: SceneRenderer | None,
    refused: tuple[str, ...] = (),
) -> list[Sample]:
    """All samples of a frame, from its first attempt that passes the checks.

    refused: why earlier attempts were, where that is known already.
    FsidError after `ATTEMPTS` attempts that were refused, and for a negative seed or frame.
    """
    seed, frame = whole(seed, "seed"), whole(frame, "frame")
    while len(refused) < ATTEMPTS:
        samples = Attempt(config, seed, frame, refused).samples(renderer)
        if isinstance(samples, list):
            return samples
        refused = (*refused, samples)
    source = f" ({Attempt(config, seed, frame).drawn_picture()[1]})" if config.images else ""
    raise FsidError(
        f"frame {frame}{source}: {ATTEMPTS} attempts were refused ({', '.join(refused)}); "
        "loosen `checks` or change what is drawn"
    )


def remake(record: dict[str, Any], renderer: SceneRenderer | None) -> Sample:
    """The sample that `record`, the content of its JSON, describes; FsidError where that is not complete."""
    try:
        config = from_plain(GenerateConfig, record["settings"], source="settings")
        index, seed = (_whole(record, key) for key in ("index", "seed"))
        frame, place = divmod(index, config.pairs_per_frame)
        scene = scene_from_json(json.dumps(record["scene"])) if "scene" in record else None
        attempt = Attempt(config, seed, frame, tuple(record["refused"]), scene)
    except (KeyError, TypeError, RecursionError) as error:
        raise FsidError(f"this is not the JSON of a sample that fsid generate wrote ({error})") from None
    samples = attempt.samples(renderer)
    if isinstance(samples, str):
        raise FsidError(f"sample {sample_key(index)}: cannot be made again, the checks now find it {samples}")
    made = samples[place].record.get("image")
    if made != record.get("image"):
        raise FsidError(
            f"sample {sample_key(index)}: was made from {record.get('image')}, but {config.images} now has "
            f"{made} in its place; put its pictures back"
        )
    _check_same_noise(samples[place].record, record)
    return samples[place]


def _check_same_noise(made: dict[str, Any], record: dict[str, Any]) -> None:
    """FsidError where the profile says another noise now than `record`; the ISO is drawn, and stays."""
    for key in ("k", "sigma2"):
        try:
            is_same = key not in record or np.allclose(made[key], record[key], rtol=_SAME_NOISE, atol=0)
        except (TypeError, ValueError, OverflowError):
            raise FsidError(f"{key}: {record[key]!r:.60} is not that of four sites") from None
        if not is_same:
            raise FsidError(
                f"sample {made['key']}: was made with another {key} than {made['profile']} says now; "
                "put the profile back as it was"
            )


def _whole(record: dict[str, Any], key: str) -> int:
    value = record[key]
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise FsidError(f"{key}: {value!r} is not a whole number of at least 0")
    return value


def encode(sample: Sample) -> dict[str, bytes]:
    """The files of a sample by extension: DNGs, a developed sRGB preview and the record."""
    preview = to_uint8(develop(sample.clean))
    return {
        "clean.dng": _dng(clean_levels(sample.clean)),
        "noisy.dng": _dng(sample.noisy),
        **dict(_further_file(name, content) for name, content in sample.more.items()),
        "rgb.png": _png(preview),
        "json": json.dumps(sample.record).encode(),
    }


def _further_file(name: str, content: Raw | np.ndarray) -> tuple[str, bytes]:
    if isinstance(content, Raw):
        return f"{name}.dng", _dng(clean_levels(content) if name == "degraded" else content)
    file = io.BytesIO()
    np.save(file, content, allow_pickle=False)
    return f"{name}.npy", file.getvalue()


def _dng(raw: Raw) -> bytes:
    file = io.BytesIO()
    write_dng(file, raw)
    return file.getvalue()


def _png(pixels: np.ndarray) -> bytes:
    """Repetitions beyond runs are not looked for: in noise-free shading they take a tenth to a fourth more
    time and make the file a tenth larger."""
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, format="PNG", compress_level=1, compress_type=zlib.Z_RLE)
    return file.getvalue()
