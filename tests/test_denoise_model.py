"""A model file gives back the network that was saved, and nothing else passes for one."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from safetensors.torch import save_file  # noqa: E402

from fsid.denoise import ModelCard, NetworkConfig, RawDenoiser, load_denoiser, save_model  # noqa: E402
from fsid.errors import FsidError  # noqa: E402
from fsid.sensor import NoiseLevel  # noqa: E402

CARD = ModelCard(NetworkConfig(width=4), patch_px=16, training="3 images of test", details={"steps": 1})


@pytest.fixture
def model_file(tmp_path: Path) -> Path:
    save_model(tmp_path / "model.safetensors", RawDenoiser(CARD.network).state_dict(), CARD)
    return tmp_path / "model.safetensors"


def test_round_trip(tmp_path: Path) -> None:
    torch.manual_seed(0)
    net = RawDenoiser(CARD.network)
    for parameter in net.parameters():
        torch.nn.init.normal_(parameter)
    save_model(tmp_path / "model.safetensors", net.state_dict(), CARD)
    for given in (tmp_path, tmp_path / "model.safetensors"):
        loaded = load_denoiser(given)
        assert loaded.card == CARD
        for name, tensor in net.state_dict().items():
            assert torch.equal(loaded.net.state_dict()[name], tensor)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["model.json", "model.safetensors"]


def test_loading_draws_no_random_number(model_file: Path) -> None:
    torch.manual_seed(0)
    before = torch.random.get_rng_state()
    load_denoiser(model_file)
    assert torch.equal(before, torch.random.get_rng_state())


def test_what_a_notebook_sets_for_its_own_networks_changes_nothing(model_file: Path) -> None:
    image = np.random.default_rng(0).random((4, 16, 16), np.float32)
    level = NoiseLevel((1e-3,) * 4, (1e-5,) * 4)
    before = load_denoiser(model_file).averages(image, level)
    torch.set_default_dtype(torch.float64)
    try:
        loaded = load_denoiser(model_file)
        with torch.autocast("cpu", torch.bfloat16):
            assert np.array_equal(loaded.averages(image, level), before)
            assert loaded.run(image, level, before).dtype == np.float32
    finally:
        torch.set_default_dtype(torch.float32)


def test_an_untrained_network_is_the_identity() -> None:
    noisy = torch.rand(2, 4, 13, 10) - 0.1
    k, sigma2 = torch.full((2, 4), 1e-3), torch.full((2, 4), 1e-5)
    torch.testing.assert_close(RawDenoiser(CARD.network)(noisy, k, sigma2), noisy, atol=1e-6, rtol=1e-5)


def test_what_is_not_a_model_is_named(model_file: Path, tmp_path: Path) -> None:
    with pytest.raises(FsidError, match="no-such"):
        load_denoiser(tmp_path / "no-such")
    data = model_file.read_bytes()
    for broken in (b"", b"\x80\x04pickle", data[:100], data[:-10]):
        model_file.write_bytes(broken)
        with pytest.raises(FsidError, match=r"model\.safetensors"):
            load_denoiser(model_file)


def test_a_folder_whose_name_is_no_text_is_named_as_such(model_file: Path) -> None:
    """What is in it is a model, which safetensors cannot open there."""
    try:
        folder = model_file.parent.rename(model_file.parent.with_name(os.fsdecode(b"run\xff")))
    except OSError:
        pytest.skip("this file system takes names in UTF-8 alone")
    with pytest.raises(FsidError, match=r"not UTF-8; rename it"):
        load_denoiser(folder)


@pytest.mark.parametrize("device", ["gpu", "meta", "cuda:99"])
def test_a_device_that_is_not_there_is_named(model_file: Path, device: str) -> None:
    """In one line: PyTorch has an error of its own for each of these."""
    with pytest.raises(FsidError, match=f"^device {device}: PyTorch cannot use it .*; cpu[^\\n]*$"):
        load_denoiser(model_file, device)


def test_a_file_that_does_not_fit_its_card_is_named(model_file: Path) -> None:
    weights = RawDenoiser(CARD.network).state_dict()
    save_file({name: tensor.contiguous() for name, tensor in weights.items()}, model_file)
    with pytest.raises(FsidError, match="no FSID model card"):
        load_denoiser(model_file)
    for change, message in (
        ({"net.intro.bias": torch.full((4,), torch.nan)}, "NaN"),
        ({"net.intro.bias": torch.full((4,), 1e300, dtype=torch.double)}, "NaN or infinity"),
        ({"net.intro.bias": torch.zeros(5)}, r"\(5,\), expected \(4,\)"),
        ({"extra": torch.zeros(1)}, "unknown tensor extra"),
    ):
        save_model(model_file, weights | change, CARD)
        with pytest.raises(FsidError, match=message):
            load_denoiser(model_file)
    del weights["net.intro.bias"]
    save_model(model_file, weights, CARD)
    with pytest.raises(FsidError, match=r"lacks tensor net\.intro\.bias"):
        load_denoiser(model_file)


def rewritten(model_file: Path, **changes: object) -> None:
    """The model with another card: whatever `changes` say, at the top or of the network."""
    card = json.loads(model_file.with_suffix(".json").read_text())
    for key, value in changes.items():
        (card["network"] if key in card["network"] else card)[key] = value
    weights = RawDenoiser(CARD.network).state_dict()
    save_file({n: t.contiguous() for n, t in weights.items()}, model_file, {"fsid_card": json.dumps(card)})


@pytest.mark.parametrize(
    ("lie", "message"),
    [
        ({"width": 4096}, "expected"),
        ({"width": 10**12}, "width"),
        ({"encoder_blocks": [1] * 9, "decoder_blocks": [1] * 9, "width": 4096}, "lacks"),
        ({"encoder_blocks": [1] * 40, "decoder_blocks": [1] * 40}, "scales"),
        ({"middle_blocks": 10**9}, "block"),
        ({"patch_px": 0}, "patch_px 0"),
        ({"patch_px": 10**9}, "patch_px"),
        ({"conditioning": "magic"}, "conditioning"),
        ({"network": [1]}, "network"),
    ],
)
def test_a_card_that_lies_is_found_out_before_it_takes_memory(
    model_file: Path, lie: dict[str, object], message: str
) -> None:
    """A network of width 4096 and nine scales has 10^14 parameters: building it would end the process."""
    rewritten(model_file, **lie)
    with pytest.raises(FsidError, match=rf"model\.safetensors: .*{message}"):
        load_denoiser(model_file)


@pytest.mark.parametrize("text", ["[1, 2]", "null", "[" * 200_000, "{", "3"])
def test_a_card_that_is_none_is_named(model_file: Path, text: str) -> None:
    weights = RawDenoiser(CARD.network).state_dict()
    save_file({n: t.contiguous() for n, t in weights.items()}, model_file, {"fsid_card": text})
    with pytest.raises(FsidError, match="not a JSON object"):
        load_denoiser(model_file)


@pytest.mark.parametrize("kind", [torch.int64, torch.bool, torch.complex64, torch.float8_e4m3fn])
def test_weights_of_another_kind_of_number_are_refused(model_file: Path, kind: torch.dtype) -> None:
    weights = {name: tensor.to(kind) for name, tensor in RawDenoiser(CARD.network).state_dict().items()}
    save_model(model_file, weights, CARD)
    with pytest.raises(FsidError, match="expected numbers of 16 to 64 bits"):
        load_denoiser(model_file)
