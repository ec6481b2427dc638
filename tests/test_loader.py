"""A patch is an isometric view of the stored image with fresh noise; (seed, step) decide all of it."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from fsid.dataset.index import index_mosaics  # noqa: E402
from fsid.dataset.loader import Batch, PatchConfig, PatchDataset, patch_rand  # noqa: E402
from fsid.dataset.shards import shard_path, write_shard  # noqa: E402
from fsid.errors import FsidError  # noqa: E402
from fsid.sensor import CFA_PATTERNS, Raw, load_profile, read_raw, write_dng  # noqa: E402

HEIGHT, WIDTH = 40, 60
CONFIG = PatchConfig(size_px=16, batch=3, profiles=("pixel6", "galaxy-s22"), iso_min=400, iso_max=6400)


def raw(dn: np.ndarray, cfa: str = "RGGB", black: int = 0, white: int = 65535) -> Raw:
    x = (dn.astype(np.float32) - black) / (white - black)
    return Raw(x, cfa, black, white, (2.0, 1.0, 1.5), np.eye(3))


def write_dataset(folder: Path, images: list[Raw], per_shard: int = 2) -> Path:
    def sample(number: int) -> tuple[str, dict[str, bytes]]:
        buffer = io.BytesIO()
        write_dng(buffer, images[number])
        return f"{number:08d}", {"clean.dng": buffer.getvalue(), "json": b"{}"}

    for first in range(0, len(images), per_shard):
        numbers = range(first, min(first + per_shard, len(images)))
        write_shard(shard_path(folder, first // per_shard), [sample(n) for n in numbers])
    return folder


@pytest.fixture
def dataset(tmp_path: Path, rng: np.random.Generator) -> Path:
    levels = {"black": 4096, "white": 65472}
    images = [raw(rng.integers(4096, 65472, (HEIGHT, WIDTH)), cfa, **levels) for cfa in CFA_PATTERNS]
    return write_dataset(tmp_path, images)


def equal(a: Batch, b: Batch) -> bool:
    return all(torch.equal(getattr(a, name), getattr(b, name)) for name in ("noisy", "clean", "k", "sigma2"))


def test_the_index_points_at_the_pixels_that_libraw_reads(dataset: Path, tmp_path: Path) -> None:
    import tarfile

    for mosaic in index_mosaics(dataset):
        stored = np.fromfile(mosaic.shard, "<u2", mosaic.height * mosaic.width, offset=mosaic.offset)
        file = tmp_path / "one.dng"
        with tarfile.open(mosaic.shard) as tar:
            file.write_bytes(tar.extractfile(f"{mosaic.key}.clean.dng").read())
        read = read_raw(file)
        assert (mosaic.cfa, mosaic.black_level, mosaic.white_level) == (read.cfa, 4096, 65472)
        x = (stored.reshape(mosaic.height, mosaic.width) - 4096.0) / (65472 - 4096)
        np.testing.assert_allclose(x, read.mosaic, atol=1e-6)


@pytest.mark.parametrize("cfa", CFA_PATTERNS)
def test_a_patch_is_an_isometry_of_the_image_in_rggb_geometry(
    cfa: str, tmp_path: Path, rng: np.random.Generator
) -> None:
    """Pixels carry their own address: packed site s at (i, j) came from origin + A (2i + r_s, 2j + c_s)."""
    address = np.arange(HEIGHT * WIDTH, dtype=np.uint16).reshape(HEIGHT, WIDTH)
    mosaic = index_mosaics(write_dataset(tmp_path, [raw(address, cfa)]))[0]
    colours = np.array(list(cfa)).reshape(2, 2)
    symmetries = set()
    for _ in range(100):
        patch = patch_rand(rng, address, mosaic, 8)
        found = np.rint(patch * 65535).astype(int)
        view = np.empty((16, 16), int)
        for site, (r, c) in zip(found, ((0, 0), (0, 1), (1, 0), (1, 1)), strict=True):
            view[r::2, c::2] = site
        place = np.stack(np.divmod(view, WIDTH), -1)
        down, right = place[1, 0] - place[0, 0], place[0, 1] - place[0, 0]
        i, j = np.mgrid[:16, :16]
        np.testing.assert_array_equal(place, place[0, 0] + i[..., None] * down + j[..., None] * right)
        assert abs(down @ right) == 0
        assert abs(down).sum() == abs(right).sum() == 1
        seen = colours[place[..., 0] % 2, place[..., 1] % 2]
        assert (seen[:2, :2] == [["R", "G"], ["G", "B"]]).all()
        symmetries.add((*down, *right))
    assert len(symmetries) == 8


def test_noise_follows_the_profile_and_the_converter(tmp_path: Path) -> None:
    grey = raw(np.full((HEIGHT, WIDTH), 0.2 * 61376 + 4096), black=4096, white=65472)
    config = replace(CONFIG, batch=64, profiles=("pixel6",), iso_min=3200, iso_max=3200)
    batch = PatchDataset(write_dataset(tmp_path, [grey]), config, seed=1)[0]
    rounding = 1 / 12 / load_profile("pixel6").span ** 2
    expected = batch.k * 0.2 + batch.sigma2 + rounding
    measured = (batch.noisy - batch.clean).square().mean((2, 3))
    assert (measured / expected).mean().item() == pytest.approx(1, abs=0.01)  # 65,536 values: 0.6 % sigma
    assert (batch.noisy - batch.clean).mean().item() == pytest.approx(0, abs=3e-4)
    assert batch.k.mean().item() == pytest.approx(np.mean(load_profile("pixel6").level(3200).k), rel=0.03)


def test_noisy_values_are_whole_dn_of_the_camera_and_clipped_at_white(tmp_path: Path) -> None:
    white = raw(np.full((HEIGHT, WIDTH), 65472), black=4096, white=65472)
    config = replace(CONFIG, profiles=("pixel6",))
    noisy = PatchDataset(write_dataset(tmp_path, [white]), config, seed=1)[0].noisy * 959 + 64
    torch.testing.assert_close(noisy, noisy.round(), atol=1e-3, rtol=0)
    assert noisy.max() <= 1023.001
    assert (noisy > 1022.5).float().mean() == pytest.approx(0.5, abs=0.05)


def test_a_batch_depends_on_seed_and_step_alone(dataset: Path) -> None:
    patches = PatchDataset(dataset, CONFIG, seed=3)
    patches[0]
    assert equal(patches[7], PatchDataset(dataset, CONFIG, seed=3)[7])
    others = [patches[8], PatchDataset(dataset, CONFIG, 4)[7], PatchDataset(dataset, CONFIG, 3, rank=1)[7]]
    assert not any(equal(patches[7], other) for other in others)


def test_loading_processes_change_nothing(dataset: Path) -> None:
    patches = PatchDataset(dataset, CONFIG, seed=3)
    patches[0]
    loader = torch.utils.data.DataLoader(patches, batch_size=None, sampler=range(2, 5), num_workers=1)
    for step, batch in zip(range(2, 5), loader, strict=True):
        assert equal(batch, patches[step])


def test_unusable_datasets_are_named(dataset: Path, tmp_path: Path) -> None:
    with pytest.raises(FsidError, match="too small for patches"):
        PatchDataset(dataset, replace(CONFIG, size_px=20), seed=0)
    with pytest.raises(FsidError, match="no-such"):
        PatchDataset(tmp_path / "no-such", CONFIG, seed=0)
    with pytest.raises(FsidError, match="no-such"):
        PatchDataset(dataset, replace(CONFIG, profiles=("no-such",)), seed=0)
    with pytest.raises(FsidError, match=r"no \*\.noisy\.dng"):
        index_mosaics(dataset, "noisy")
    shard = shard_path(dataset, 0)
    shard.write_bytes(shard.read_bytes()[:5000])
    with pytest.raises(FsidError, match=r"shard-00000\.tar"):
        index_mosaics(dataset)
