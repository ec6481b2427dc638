"""Lux become electrons by radiometry, and electrons become a signal by the profile's own gain."""

from dataclasses import replace

import numpy as np
import pytest

from fsid.errors import FsidError
from fsid.evaluate import photo_testset
from fsid.sensor import NoiseTerms, light_level, load_profile, read_raw, save_profile
from fsid.sensor.light import KEY, LONGEST_EXPOSURE_S, PHOTONS_PER_LUX_M2_S, electrons_per_second

PIXEL = load_profile("pixel6")


def test_photons_of_a_lux_lie_between_green_light_and_the_sun():
    """Monochromatic 555 nm light has the fewest photons per lux: 1 / (683 lm/W * h c / 555 nm)."""
    green = 1 / (683 * 6.62607e-34 * 2.99792e8 / 555e-9)
    assert green < PHOTONS_PER_LUX_M2_S < 4 * green


def test_electrons_by_hand():
    """1000 lux on a grey card: 1000 * 0.18 * 0.9 / (4 * 1.85^2) lux on the sensor, 5.76 um^2, QE 0.28."""
    on_sensor = 1000 * 0.18 * 0.9 / (4 * 1.85**2)
    by_hand = on_sensor * 1.115e16 * 5.76e-12 * 0.28
    assert electrons_per_second(PIXEL, 1000) == pytest.approx(by_hand, rel=1e-3)


def test_time_comes_before_iso_and_iso_before_darkness():
    lux = np.geomspace(0.01, 30000, 40)
    levels = [light_level(PIXEL, value) for value in lux]
    times, isos, signals = (
        np.array([getattr(v, n) for v in levels]) for n in ("exposure_s", "iso", "signal")
    )
    assert np.all(np.diff(times) <= 0)
    assert np.all(np.diff(isos) <= 1e-9)
    assert np.all(np.diff(signals) >= -1e-9)
    assert np.all((isos < 49.01) | (times == 0.1))
    assert np.all((signals > KEY * 0.999) | (isos > 4 * 3199 * 0.999))
    assert levels[-1].signal == pytest.approx(KEY)


def test_half_a_lux_with_a_pixel_6():
    level = light_level(PIXEL, 0.5)
    assert level.exposure_s == 0.1
    assert 5 < level.electrons < 20
    assert level.iso == pytest.approx(4 * 3199)
    k = PIXEL.level(level.iso).k
    assert level.signal == pytest.approx(level.electrons * (k[1] + k[2]) / 2)
    half = light_level(PIXEL, 0.5, longest_exposure_s=0.05)
    assert half.electrons == pytest.approx(level.electrons / 2)


def test_the_test_bench_takes_lux(photos, tmp_path):
    testset = photo_testset([photos], tmp_path, camera="pixel6", isos=[800], luxes=[0.5])
    assert testset.levels == ("iso800", "0.5lux")
    capture = read_raw(tmp_path / testset.images[0].name / "0.5lux.noisy.dng")
    grey_electrons = KEY / np.mean(PIXEL.level(capture.iso).k[1:3])
    assert grey_electrons == pytest.approx(light_level(PIXEL, 0.5).electrons, rel=1e-3)


def test_dark_current_flows_at_an_iso_as_it_does_in_lux(photos, tmp_path):
    means = []
    for terms in (NoiseTerms(dark_current_e_s=1000.0), NoiseTerms()):
        save_profile(tmp_path / "camera.yaml", replace(PIXEL, terms=terms))
        out = tmp_path / f"{terms.dark_current_e_s:g}"
        testset = photo_testset([photos], out, camera=tmp_path / "camera.yaml", isos=[800])
        captures = testset.captures(out)
        means.append(np.mean([read_raw(capture).mosaic.mean() for capture in captures]))
    electrons = 1000 * LONGEST_EXPOSURE_S
    assert means[0] - means[1] == pytest.approx(electrons * np.mean(PIXEL.level(800).k), rel=0.05)


def test_what_cannot_be_computed_is_named(tmp_path):
    with pytest.raises(FsidError, match=r"galaxy-s20-fe.*optics"):
        light_level(load_profile("galaxy-s20-fe"), 1)
    for lux in (0, -1, float("nan"), float("inf")):
        for light in (light_level, electrons_per_second):
            with pytest.raises(FsidError, match=f"light of {lux} lux"):
                light(PIXEL, lux)
    with pytest.raises(FsidError, match="reflectance 0"):
        light_level(PIXEL, 1, reflectance=0)
    for seconds in (0, float("nan")):
        with pytest.raises(FsidError, match=f"longest_exposure_s {seconds}: must be above 0"):
            light_level(PIXEL, 1, longest_exposure_s=seconds)
    for iso in (10, 0, -5, float("nan")):
        with pytest.raises(FsidError, match=rf"highest_iso {iso}: .* 49, the lowest ISO of profile pixel6"):
            light_level(PIXEL, 1, highest_iso=iso)
    save_profile(tmp_path / "p.yaml", PIXEL)
    assert load_profile(tmp_path / "p.yaml").optics == PIXEL.optics
    text = (tmp_path / "p.yaml").read_text()
    (tmp_path / "bad.yaml").write_text(text.replace("f_number: 1.85", "f_number: -1"))
    with pytest.raises(FsidError, match=r"bad\.yaml: optics"):
        load_profile(tmp_path / "bad.yaml")
    with pytest.raises(FsidError, match="optics"):
        light_level(replace(PIXEL, optics=None), 1)


def test_no_shutter_is_faster_than_a_hundred_thousandth():
    level = light_level(PIXEL, 1e8)
    assert level.exposure_s == pytest.approx(1e-5)
    assert level.signal > KEY
