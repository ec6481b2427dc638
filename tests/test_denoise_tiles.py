"""Tiles are an implementation detail: no size, pattern or tile changes what comes out."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from fsid.denoise import Denoiser, ModelCard, NetworkConfig, RawDenoiser, denoise_raw  # noqa: E402
from fsid.denoise.denoise import _denoise_packed, _pooling_patches  # noqa: E402
from fsid.denoise.nafnet import SpatialMean  # noqa: E402
from fsid.errors import FsidError  # noqa: E402
from fsid.sensor import CFA_PATTERNS, NoiseLevel, Raw, load_profile  # noqa: E402

LEVEL = load_profile("pixel6").level(3200)


def raw(rng: np.random.Generator, height: int, width: int, cfa: str = "RGGB") -> Raw:
    ramp = (
        np.linspace(0, 0.8, width, dtype=np.float32) * np.linspace(0.3, 1, height, dtype=np.float32)[:, None]
    )
    noisy = ramp + 0.03 * rng.standard_normal((height, width), dtype=np.float32)
    return Raw(noisy, cfa, 64, 1023, (2.0, 1.0, 1.5), np.eye(3), "test", 3200, LEVEL)


def denoiser(network: NetworkConfig | None = None, patch_px: int = 16, active: bool = True) -> Denoiser:
    torch.manual_seed(0)
    network = network or NetworkConfig(width=8)
    net = RawDenoiser(network)
    if active:
        for name, parameter in net.named_parameters():
            if name.endswith(("beta", "gamma", "ending.weight")):
                torch.nn.init.normal_(parameter, std=0.3)
    return Denoiser(net.eval().requires_grad_(False), ModelCard(network, patch_px), torch.device("cpu"))


@pytest.mark.parametrize("network", [NetworkConfig(width=8), NetworkConfig(4, (1, 1, 1), 1, (1, 1, 1))])
@pytest.mark.parametrize(("height", "width", "cfa"), [(130, 202, "RGGB"), (122, 146, "GBRG")])
def test_tiled_equals_untiled(
    rng: np.random.Generator, network: NetworkConfig, height: int, width: int, cfa: str
) -> None:
    noisy, model = raw(rng, height, width, cfa), denoiser(network)
    whole = denoise_raw(noisy, model, tile_px=4096).mosaic
    assert np.abs(whole - noisy.mosaic).mean() > 1e-3  # the network does something that could differ
    for tile_px in (16, 33, 100):
        np.testing.assert_allclose(
            denoise_raw(noisy, model, tile_px=tile_px).mosaic, whole, atol=1e-4, rtol=0
        )


@pytest.mark.parametrize("cfa", CFA_PATTERNS)
@pytest.mark.parametrize(("height", "width"), [(2, 2), (6, 10), (34, 50)])
def test_the_identity_network_returns_every_pixel_in_place(
    rng: np.random.Generator, cfa: str, height: int, width: int
) -> None:
    noisy = raw(rng, height, width, cfa)
    clean = denoise_raw(noisy, denoiser(active=False), tile_px=8)
    np.testing.assert_allclose(clean.mosaic, noisy.mosaic, atol=1e-5)
    for name in ("cfa", "black_level", "white_level", "white_balance", "xyz_to_camera", "camera", "iso"):
        assert np.array_equal(getattr(clean, name), getattr(noisy, name))
    assert clean.noise is None


def test_the_network_sees_one_geometry_whatever_the_pattern(rng: np.random.Generator) -> None:
    """The same scene with an odd first column cut off (RGGB becomes GRBG) is denoised to the same pixels.

    The scene's outer columns are mirror images, so that padding brings back just what the cut took away.
    """
    model, whole = denoiser(patch_px=64), raw(rng, 64, 64)
    cut = replace(whole, mosaic=np.ascontiguousarray(whole.mosaic[:, 1:-1]), cfa="GRBG")
    mirrored = replace(whole, mosaic=np.pad(cut.mosaic, ((0, 0), (1, 1)), mode="reflect"))
    expected = denoise_raw(mirrored, model).mosaic[:, 1:-1]
    np.testing.assert_allclose(denoise_raw(cut, model).mosaic, expected, atol=1e-4)


def test_a_small_image_is_what_the_bare_network_makes_of_it(rng: np.random.Generator) -> None:
    noisy, model = raw(rng, 64, 64), denoiser(patch_px=32)
    packed = np.stack([noisy.mosaic[r::2, c::2] for r in (0, 1) for c in (0, 1)])
    k, sigma2 = torch.tensor([LEVEL.k]), torch.tensor([LEVEL.sigma2])
    expected = model.net(torch.from_numpy(packed)[None], k, sigma2)[0].numpy()
    clean = denoise_raw(noisy, model, tile_px=8).mosaic
    np.testing.assert_allclose(clean[::2, 1::2], expected[1], atol=1e-5)


def test_averages_are_of_patches_spread_over_the_image() -> None:
    """About sixteen, each in the middle of its cell of an even grid; pixels carry their own address. What a
    network is given, and here gives back, is the mean of what it made of them all."""
    address = np.arange(60 * 200, dtype=np.float32).reshape(1, 60, 200)
    patches = list(_pooling_patches(address, 10))
    assert {patch.shape for patch in patches} == {(1, 10, 10)}
    model = SimpleNamespace(
        card=SimpleNamespace(patch_px=10),
        multiple=4,
        receptive_radius=4,
        averages=lambda patch, level: patch.mean() ** 2,
        run=lambda tile, level, averages: np.full_like(tile, averages),
    )
    given = _denoise_packed(address, model, LEVEL, 64, lambda *_: None)
    np.testing.assert_allclose(given, np.mean([patch.mean() ** 2 for patch in patches]), rtol=1e-5)
    found = [divmod(int(patch[0, 0, 0]), 200) for patch in patches]
    assert found == [(row, column) for row in (12, 38) for column in (14, 41, 68, 95, 122, 149, 176)]
    (upright,) = _pooling_patches(address[:, :20, :20], 10)
    assert upright.shape == (1, 20, 20)
    assert {patch.shape for patch in _pooling_patches(address[:, :20, :21], 10)} == {(1, 10, 10)}


def test_threads_may_share_a_network(rng: np.random.Generator) -> None:
    """Those averages of one image must not get into another's tiles."""
    model = denoiser()
    images = [replace(raw(rng, 96, 96), mosaic=share * raw(rng, 96, 96).mosaic) for share in (1.0, 0.5, 0.1)]
    expected = [denoise_raw(image, model, tile_px=8).mosaic for image in images]
    with ThreadPoolExecutor(3) as threads:
        found = list(threads.map(lambda image: denoise_raw(image, model, tile_px=8).mosaic, images))
    for mosaic, alone in zip(found, expected, strict=True):
        np.testing.assert_array_equal(mosaic, alone)


def test_a_network_may_be_called_while_another_thread_denoises(rng: np.random.Generator) -> None:
    """After each block, so while averages are taken and while they are held: neither sees the other."""
    model, image = denoiser(), raw(rng, 96, 96)
    packed = torch.from_numpy(rng.random((1, 4, 24, 24), dtype=np.float32))
    other_image = packed, torch.tensor([LEVEL.k]), torch.tensor([LEVEL.sigma2])
    expected, alone = model.net(*other_image), denoise_raw(image, model, tile_px=16).mosaic
    found = []

    def meanwhile(*_: object) -> None:
        if threading.current_thread() is threading.main_thread():
            found.append(other.submit(model.net, *other_image).result())

    with ThreadPoolExecutor(1) as other:
        for module in model.net.modules():
            if isinstance(module, SpatialMean):
                module.register_forward_hook(meanwhile)
        beside = denoise_raw(image, model, tile_px=16).mosaic
    assert all(torch.equal(output, expected) for output in found)
    np.testing.assert_array_equal(beside, alone)


def test_progress_counts_tiles(rng: np.random.Generator) -> None:
    calls: list[tuple[int, int]] = []
    denoise_raw(raw(rng, 64, 96), denoiser(), tile_px=16, progress=lambda *done: calls.append(done))
    assert calls == [(i, 6) for i in range(1, 7)]


def test_bad_input_is_named(rng: np.random.Generator) -> None:
    noisy, model = raw(rng, 32, 32), denoiser()
    with pytest.raises(FsidError, match="noise level of this RAW is unknown"):
        denoise_raw(replace(noisy, noise=None), model)
    with pytest.raises(FsidError, match="0 to 1 is possible"):
        denoise_raw(noisy, model, NoiseLevel((-1e-3,) * 4, (0.0,) * 4))
    with pytest.raises(FsidError, match="0 to 1 is possible"):
        denoise_raw(noisy, model, NoiseLevel((1e30,) * 4, (0.0,) * 4))
    with pytest.raises(FsidError, match="four values each"):
        denoise_raw(noisy, model, NoiseLevel((1e-3,), (1e-5,)))  # type: ignore[arg-type]
    with pytest.raises(FsidError, match="a ndarray is no Raw: read_raw reads one"):
        denoise_raw(noisy.mosaic, model)  # type: ignore[arg-type]
    with torch.no_grad():
        (exploding := denoiser()).net.net.ending.weight.fill_(1e30)
    with pytest.raises(FsidError, match="weights are broken"):
        denoise_raw(noisy, exploding)
    broken = noisy.mosaic.copy()
    broken[3, 3] = np.nan
    with pytest.raises(FsidError, match="NaN"):
        denoise_raw(replace(noisy, mosaic=broken), model)
