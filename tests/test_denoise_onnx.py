"""An exported network means the same as the network: one call, tiles, any size, and no package needed."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("onnxscript")
onnx = pytest.importorskip("onnx")
onnxruntime = pytest.importorskip("onnxruntime")

from fsid.cli.main import main  # noqa: E402
from fsid.config import to_plain  # noqa: E402
from fsid.denoise import Denoiser, ModelCard, NetworkConfig, RawDenoiser, denoise_raw, save_model  # noqa: E402
from fsid.denoise.export import export  # noqa: E402
from fsid.denoise.model import load_denoiser  # noqa: E402
from fsid.denoise.onnx_denoiser import OnnxDenoiser, load_onnx, onnx_denoiser  # noqa: E402
from fsid.denoise.onnx_export import onnx_bytes, onnx_model  # noqa: E402
from fsid.denoise.onnx_int8 import eight_bit  # noqa: E402
from fsid.denoise.probes import CALIBRATED, mean_psnr, probes  # noqa: E402
from fsid.errors import FsidError  # noqa: E402
from fsid.sensor import NoiseLevel, Raw, load_profile, read_raw, write_dng  # noqa: E402

NETWORK = NetworkConfig(width=4, encoder_blocks=(1, 1), middle_blocks=1, decoder_blocks=(1, 1))
LEVEL = load_profile("pixel6").level(3200)


@pytest.fixture(scope="module")
def denoiser() -> Denoiser:
    torch.manual_seed(0)
    net = RawDenoiser(NETWORK)
    for name, parameter in net.named_parameters():
        if name.endswith(("beta", "gamma", "ending.weight")):
            torch.nn.init.normal_(parameter, std=0.3)
    return Denoiser(net.eval().requires_grad_(False), ModelCard(NETWORK, 16), torch.device("cpu"))


@pytest.fixture(scope="module")
def exported(denoiser: Denoiser) -> bytes:
    return onnx_bytes(denoiser)


@pytest.fixture(scope="module")
def network(exported: bytes) -> OnnxDenoiser:
    return onnx_denoiser(exported, "test")


def noisy_raw(rng: np.random.Generator, height: int, width: int, cfa: str = "RGGB") -> Raw:
    x = np.linspace(0, 0.8, width, dtype=np.float32) + 0.05 * rng.standard_normal((height, width))
    return Raw(x.astype(np.float32), cfa, 64, 1023, (2.0, 1.0, 1.5), np.eye(3), "test", 3200, LEVEL)


@pytest.mark.parametrize(("height", "width", "cfa"), [(64, 64, "RGGB"), (98, 146, "GBRG"), (34, 200, "BGGR")])
def test_whole_and_in_tiles_it_equals_pytorch(
    rng: np.random.Generator, denoiser: Denoiser, network: OnnxDenoiser, height: int, width: int, cfa: str
) -> None:
    raw = noisy_raw(rng, height, width, cfa)
    expected = denoise_raw(raw, denoiser, tile_px=4096).mosaic
    assert np.abs(expected - raw.mosaic).mean() > 1e-3
    for tile_px in (4096, 24):
        np.testing.assert_allclose(
            denoise_raw(raw, network, tile_px=tile_px).mosaic, expected, atol=1e-4, rtol=0
        )


def test_an_image_without_noise_is_what_pytorch_makes_of_it(
    rng: np.random.Generator, denoiser: Denoiser, network: OnnxDenoiser
) -> None:
    raw = replace(noisy_raw(rng, 34, 66), noise=NoiseLevel((0.0,) * 4, (0.0,) * 4))
    expected = denoise_raw(raw, denoiser).mosaic
    np.testing.assert_allclose(denoise_raw(raw, network).mosaic, expected, atol=1e-6, rtol=0)


def test_an_export_that_fails_without_noise_is_refused(
    denoiser: Denoiser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a floor of 0 nothing differs at the levels of a camera."""
    save_model(tmp_path / "model.safetensors", denoiser.net.state_dict(), denoiser.card)
    monkeypatch.setattr("fsid.denoise.stabilise._READ_FLOOR", 0.0)
    with pytest.raises(FsidError, match="NaN"):
        export(tmp_path / "model.safetensors", tmp_path / "model.onnx")
    assert not (tmp_path / "model.onnx").exists()


def test_a_network_without_blocks_is_refused(tmp_path: Path, refused: Callable[..., str]) -> None:
    """The exporter of PyTorch ends with a traceback: there are no averages to take or give."""
    bare = NetworkConfig(width=4, encoder_blocks=(0,), middle_blocks=0, decoder_blocks=(0,))
    save_model(tmp_path / "a.safetensors", RawDenoiser(bare).state_dict(), ModelCard(bare, 16))
    told = refused("export", tmp_path / "a.safetensors", tmp_path / "a.onnx")
    assert "a.safetensors: has no blocks" in told
    assert not (tmp_path / "a.onnx").exists()


def test_the_graph_alone_is_enough(rng: np.random.Generator, denoiser: Denoiser, exported: bytes) -> None:
    """Three inputs, any size, plain onnxruntime: what a phone would do with a whole image."""
    session = onnxruntime.InferenceSession(exported, providers=["CPUExecutionProvider"])
    packed = rng.random((1, 4, 23, 37), dtype=np.float32)
    k, sigma2 = np.array([LEVEL.k], np.float32), np.array([LEVEL.sigma2], np.float32)
    (clean,) = session.run(["clean"], {"noisy": packed, "k": k, "sigma2": sigma2})
    expected = denoiser.net(*map(torch.from_numpy, (packed, k, sigma2))).numpy()
    np.testing.assert_allclose(clean, expected, atol=1e-4)
    notes = session.get_modelmeta().custom_metadata_map
    for word in ("black", "R, Gr, Gb, B", "NoiseProfile", "receptive_radius", "unpack", "brightest"):
        assert word.lower() in notes["description"].lower()
    assert notes["multiple"] == "4"
    assert notes["patch_px"] == "16"


def as_described(graph: bytes, raw: Raw, tile: int) -> np.ndarray:
    """The file's `description`, line by line, with NumPy and onnxruntime alone."""
    session = onnxruntime.InferenceSession(graph, providers=["CPUExecutionProvider"])
    notes = session.get_modelmeta().custom_metadata_map
    multiple, radius, patch = (int(notes[key]) for key in ("multiple", "receptive_radius", "patch_px"))
    assert raw.noise is not None
    level = {"k": np.array([raw.noise.k], "f4"), "sigma2": np.array([raw.noise.sigma2], "f4")}
    top, left = divmod(raw.cfa.index("R"), 2)
    height, width = raw.mosaic.shape
    below, beyond = -(height + top) % (2 * multiple), -(width + left) % (2 * multiple)
    x = np.pad(raw.mosaic, ((top, below), (left, beyond)), mode="reflect")
    planes = np.stack([x[0::2, 0::2], x[0::2, 1::2], x[1::2, 0::2], x[1::2, 1::2]])[None]
    rows, columns = planes.shape[2:]
    if max(rows, columns) <= 2 * patch:
        (clean,) = session.run(["clean"], {"noisy": planes, **level})
    else:
        starts = []
        for side, count in (
            (rows, round(4 * (rows / columns) ** 0.5)),
            (columns, round(4 * (columns / rows) ** 0.5)),
        ):
            count = max(1, count)
            starts.append([round(max(side - patch, 0) * (i + 0.5) / count) for i in range(count)])
        seen = [planes[..., r : r + patch, c : c + patch] for r in starts[0] for c in starts[1]]
        runs = [session.run(["averages_out"], {"noisy": window, **level})[0] for window in seen]
        level |= {"averages": np.mean(runs, axis=0, dtype="f4"), "frozen": np.ones((), "f4")}
        overlap, clean = -(-radius // multiple) * multiple, np.empty_like(planes)
        for r in range(0, rows, tile):
            for c in range(0, columns, tile):
                first, start = max(r - overlap, 0), max(c - overlap, 0)
                window = planes[..., first : r + tile + overlap, start : c + tile + overlap]
                (done,) = session.run(["clean"], {"noisy": window, **level})
                clean[..., r : r + tile, c : c + tile] = done[..., r - first :, c - start :][
                    ..., :tile, :tile
                ]
    for plane, found in zip(planes[0], clean[0], strict=True):
        dn = np.rint(plane * (raw.white_level - raw.black_level))
        n, m = np.sum(dn == dn.max()), np.sum(dn == dn.max() - 1)
        limit = plane.max() if plane.max() > 0.5 and n - m > 5 * (n + m) ** 0.5 else max(1, x.max())
        np.minimum(found, limit, out=found)
    out = np.empty_like(x)
    out[0::2, 0::2], out[0::2, 1::2], out[1::2, 0::2], out[1::2, 1::2] = clean[0]
    return out[top : top + height, left : left + width]


@pytest.mark.parametrize("saturated", [1, 0.96])
@pytest.mark.parametrize(("height", "width", "cfa"), [(52, 58, "GRBG"), (98, 146, "GBRG"), (20, 166, "BGGR")])
def test_the_description_in_the_file_is_enough(
    rng: np.random.Generator,
    denoiser: Denoiser,
    exported: bytes,
    height: int,
    width: int,
    cfa: str,
    saturated: float,
) -> None:
    raw = noisy_raw(rng, height, width, cfa)
    raw.mosaic[:, width // 2 :] = saturated  # light,  light, of which the graph makes more
    expected = denoise_raw(raw, denoiser).mosaic
    assert np.abs(expected - raw.mosaic).mean() > 1e-3
    for tile in (24, 4096):
        np.testing.assert_allclose(as_described(exported, raw, tile), expected, atol=1e-4, rtol=0)


def test_the_command_writes_a_smaller_form_and_denoise_runs_it(
    rng: np.random.Generator,
    denoiser: Denoiser,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    few = probes(("coffee.png",))[:1]
    monkeypatch.setattr("fsid.denoise.export.probes", lambda: few)
    monkeypatch.setattr("fsid.denoise.onnx_int8.probes", lambda names, isos: few)
    save_model(tmp_path / "model.safetensors", denoiser.net.state_dict(), denoiser.card)
    small = tmp_path / "small.ONNX"  # what kind it is does not hang on its letters
    main(["export", str(tmp_path / "model.safetensors"), str(small), "--precision", "int8"])
    said = capfd.readouterr().err
    assert "int8" in said
    assert "onnxruntime" not in said  # it warns of what is meant to be
    kinds = {node.op_type for node in onnx.load(small).graph.node}
    assert {"QuantizeLinear", "DequantizeLinear"} <= kinds
    assert str(tmp_path) not in small.read_bytes().decode("latin1")  # no paths, no stack traces
    assert "site-packages" not in small.read_bytes().decode("latin1")
    raw = noisy_raw(rng, 96, 128)
    write_dng(tmp_path / "noisy.dng", raw)
    main(
        [
            "denoise",
            str(tmp_path / "noisy.dng"),
            str(tmp_path / "clean.dng"),
            "--model",
            str(small),
            "--quiet",
        ]
    )
    eight_bit = denoise_raw(few[0].noisy, load_onnx(small)).mosaic
    off = np.abs(eight_bit - denoise_raw(few[0].noisy, denoiser).mosaic).max()
    assert f"differs from PyTorch by {off:.1e}" in said
    expected = denoise_raw(read_raw(tmp_path / "noisy.dng"), denoiser).mosaic
    got = read_raw(tmp_path / "clean.dng").mosaic
    assert np.corrcoef(got.ravel(), expected.clip(max=1).ravel())[0, 1] > 0.98


def test_eight_bits_keep_colours_and_detail_in_noise_of_any_strength(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fsid.denoise.onnx_int8.CALIBRATED", CALIBRATED[:1])
    shipped = load_denoiser()
    small = onnx_denoiser(eight_bit(onnx_model(shipped)).SerializeToString(), "small")
    for probe in probes(("coffee.png",), (100, 3200, 51200, 64000)):
        assert mean_psnr(shipped, [probe]) - mean_psnr(small, [probe]) < 0.2
        mean, small_mean = (denoise_raw(probe.noisy, n).mosaic.mean(dtype=float) for n in (shipped, small))
        assert small_mean == pytest.approx(mean, rel=0.005)


def test_half_precision_stays_near(rng: np.random.Generator, denoiser: Denoiser) -> None:
    graph = onnx_model(denoiser, half=True)
    assert any(tensor.data_type == onnx.TensorProto.FLOAT16 for tensor in graph.graph.initializer)
    raw = noisy_raw(rng, 64, 64)
    half = denoise_raw(raw, onnx_denoiser(graph.SerializeToString(), "half")).mosaic
    single = denoise_raw(raw, denoiser).mosaic
    assert np.abs(half - single).max() < 0.1 * np.abs(single - raw.mosaic).mean()


def test_what_is_no_exported_network_is_named(tmp_path: Path) -> None:
    for content in (b"", b"\x80\x04pickle"):
        (tmp_path / "broken.onnx").write_bytes(content)
        with pytest.raises(FsidError, match=r"broken\.onnx"):
            load_onnx(tmp_path / "broken.onnx")
    with pytest.raises(FsidError, match=r"none\.onnx"):
        load_onnx(tmp_path / "none.onnx")
    value = onnx.helper.make_tensor_value_info("x", onnx.TensorProto.FLOAT, [1])
    out = onnx.helper.make_tensor_value_info("y", onnx.TensorProto.FLOAT, [1])
    graph = onnx.helper.make_graph([onnx.helper.make_node("Neg", ["x"], ["y"])], "g", [value], [out])
    model = onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 17)], ir_version=8)
    (tmp_path / "other.onnx").write_bytes(model.SerializeToString())
    with pytest.raises(FsidError, match=r"other\.onnx: is not a file of `fsid export`"):
        load_onnx(tmp_path / "other.onnx")


def altered(graph: bytes, **notes: str) -> Any:
    """The exported model with other metadata."""
    model = onnx.load_from_string(graph)
    onnx.helper.set_model_props(model, {p.key: p.value for p in model.metadata_props} | notes)
    return model


def test_metadata_that_lies_is_found_out(
    rng: np.random.Generator, denoiser: Denoiser, exported: bytes, network: OnnxDenoiser
) -> None:
    for text in ("[1]", "null", "[" * 200_000, "{"):
        with pytest.raises(FsidError, match="not a JSON object"):
            onnx_denoiser(altered(exported, fsid_card=text).SerializeToString(), "lie")
    raw = noisy_raw(rng, 64, 96)
    lied = onnx_denoiser(altered(exported, multiple="0", receptive_radius="-9").SerializeToString(), "lie")
    np.testing.assert_array_equal(
        denoise_raw(raw, lied, tile_px=24).mosaic, denoise_raw(raw, network, tile_px=24).mosaic
    )
    smaller = json.dumps(to_plain(replace(denoiser.card, network=replace(NETWORK, middle_blocks=0))))
    assert onnx_denoiser(altered(exported, fsid_card=smaller).SerializeToString(), "lie").receptive_radius < (
        network.receptive_radius
    )


def test_a_graph_that_does_something_else_is_named(
    rng: np.random.Generator, exported: bytes, capfd: pytest.CaptureFixture[str]
) -> None:
    """The right names and another meaning: `clean` is of another shape, or the graph stops midway. What is
    wrong is said once: onnxruntime itself would print the names in the file as they are."""
    raw, model = noisy_raw(rng, 64, 96), altered(exported)
    (last,) = (node for node in model.graph.node if "clean" in node.output)
    last.output[0] = "hidden"
    axes = onnx.numpy_helper.from_array(np.array([2, 3]), "axes")
    model.graph.initializer.append(axes)
    model.graph.node.append(onnx.helper.make_node("ReduceMean", ["hidden", "axes"], ["clean"], keepdims=1))
    model.graph.output[0].type.tensor_type.ClearField("shape")
    with pytest.raises(FsidError, match=r"lie: makes \(1, 4, 1, 1\)"):
        denoise_raw(raw, onnx_denoiser(model.SerializeToString(), "lie"))
    model.graph.node[-1].op_type = "Reshape"
    model.graph.node[-1].ClearField("attribute")
    model.graph.node[-1].name = "\x1b[2J"
    with pytest.raises(FsidError, match="lie: onnxruntime cannot run it"):
        denoise_raw(raw, onnx_denoiser(model.SerializeToString(), "lie"))
    assert capfd.readouterr().err == ""
