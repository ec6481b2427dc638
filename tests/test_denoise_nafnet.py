"""NAFNet: the published names, the published block, and a known reach once its averages are frozen."""

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch")

from fsid.denoise.nafnet import NAFBlock, NAFNet, frozen_pooling, pooling  # noqa: E402


def randomised(net: torch.nn.Module, seed: int = 0) -> torch.nn.Module:
    """Zero-initialised residual scales would hide every block from a test."""
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for name, parameter in net.named_parameters():
            if name.endswith(("beta", "gamma")):
                parameter.copy_(torch.randn(parameter.shape, generator=generator) * 0.5)
    return net


def reference_block_shapes(prefix: str, c: int) -> dict[str, tuple[int, ...]]:
    convolutions = {
        "conv1": (2 * c, c, 1, 1),
        "conv2": (2 * c, 1, 3, 3),
        "conv3": (c, c, 1, 1),
        "sca.1": (c, c, 1, 1),
        "conv4": (2 * c, c, 1, 1),
        "conv5": (c, c, 1, 1),
    }
    shapes = {f"{prefix}.{name}.weight": shape for name, shape in convolutions.items()}
    shapes |= {f"{prefix}.{name}.bias": shape[:1] for name, shape in convolutions.items()}
    shapes |= {f"{prefix}.{norm}.{part}": (c,) for norm in ("norm1", "norm2") for part in ("weight", "bias")}
    return shapes | {f"{prefix}.beta": (1, c, 1, 1), f"{prefix}.gamma": (1, c, 1, 1)}


def test_parameters_have_the_names_and_shapes_of_the_reference() -> None:
    net = NAFNet(3, 3, 32, (2, 1), 3, (1, 2))
    expected = {
        "intro.weight": (32, 3, 3, 3),
        "intro.bias": (32,),
        "ending.weight": (3, 32, 3, 3),
        "ending.bias": (3,),
        "downs.0.weight": (64, 32, 2, 2),
        "downs.0.bias": (64,),
        "downs.1.weight": (128, 64, 2, 2),
        "downs.1.bias": (128,),
        "ups.0.0.weight": (256, 128, 1, 1),
        "ups.1.0.weight": (128, 64, 1, 1),
    }
    for prefix, width in [("encoders.0.0", 32), ("encoders.0.1", 32), ("encoders.1.0", 64)]:
        expected |= reference_block_shapes(prefix, width)
    for number in range(3):
        expected |= reference_block_shapes(f"middle_blks.{number}", 128)
    for prefix, width in [("decoders.0.0", 64), ("decoders.1.0", 32), ("decoders.1.1", 32)]:
        expected |= reference_block_shapes(prefix, width)
    assert {name: tuple(tensor.shape) for name, tensor in net.state_dict().items()} == expected


def test_a_block_computes_the_published_equations() -> None:
    torch.manual_seed(0)
    block = randomised(NAFBlock(4))
    x = torch.randn(2, 4, 5, 6)

    def norm(t: torch.Tensor) -> torch.Tensor:
        mean = t.mean(1, keepdim=True)
        return (t - mean) / torch.sqrt(((t - mean) ** 2).mean(1, keepdim=True) + 1e-6)

    wide = block.conv2(block.conv1(norm(x)))
    gated = wide[:, :4] * wide[:, 4:]
    attended = gated * block.sca[1](gated.mean((2, 3), keepdim=True))
    u = x + block.beta * block.conv3(attended)
    wide = block.conv4(norm(u))
    expected = u + block.gamma * block.conv5(wide[:, :4] * wide[:, 4:])
    torch.testing.assert_close(block(x), expected, atol=1e-5, rtol=1e-4)


@pytest.mark.parametrize("size", [(8, 8), (7, 9), (1, 3)])
def test_any_size(size: tuple[int, int]) -> None:
    net = randomised(NAFNet(8, 4, 8, (1, 1), 1, (1, 1)))
    assert net(torch.randn(1, 8, *size)).shape == (1, 4, *size)


@pytest.mark.parametrize(("encoder", "middle"), [((1,), 1), ((2, 1), 2)])
def test_with_frozen_averages_nothing_reaches_beyond_the_receptive_radius(
    encoder: tuple[int, ...], middle: int
) -> None:
    net = randomised(NAFNet(4, 4, 4, encoder, middle, encoder[::-1])).double()
    torch.manual_seed(1)
    image = torch.randn(1, 4, 80, 80, dtype=torch.double)
    for centre in (40, 41, 42, 43):  # one per position in a cell of the coarsest scale
        probe = image.clone().requires_grad_()
        with frozen_pooling(net, pooling(net, lambda: net(image))):
            net(probe)[0, :, centre, centre].sum().backward()
        rows, columns = probe.grad.abs().sum((0, 1)).nonzero().T
        assert max((rows - centre).abs().max(), (columns - centre).abs().max()) <= net.receptive_radius


def test_freezing_on_the_image_itself_changes_nothing_and_ends_with_the_context() -> None:
    net = randomised(NAFNet(4, 4, 4, (1, 1), 1, (1, 1)))
    torch.manual_seed(2)
    image, other = torch.randn(2, 1, 4, 16, 16)
    with torch.no_grad():
        plain, plain_other = net(image), net(other)
        with frozen_pooling(net, pooling(net, lambda: net(image))):
            torch.testing.assert_close(net(image), plain)
            assert (net(other) - plain_other).abs().max() > 1e-5
        torch.testing.assert_close(net(other), plain_other, rtol=0, atol=0)
