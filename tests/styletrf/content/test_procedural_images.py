import numpy as np
import pytest

from styletrf.content.procedural_images import procedural_image, spectral_noise


@pytest.mark.parametrize("exponent", [0.5, 1.0, 1.5])
def test_amplitude_of_noise_falls_with_the_exponent(exponent: float):
    generator, side = np.random.default_rng(0), 256
    noise = spectral_noise(generator, side, side, exponent)
    amplitude = np.abs(np.fft.fft2(noise))
    frequency = np.hypot(np.fft.fftfreq(side)[:, None], np.fft.fftfreq(side))
    kept = (frequency > 0.01) & (frequency < 0.5)
    slope, _ = np.polyfit(np.log(frequency[kept]), np.log(amplitude[kept]), 1)
    assert slope == pytest.approx(-exponent, abs=0.05)
    assert noise.mean() == pytest.approx(0, abs=1e-9)
    assert noise.std() == pytest.approx(1)


@pytest.mark.parametrize("shape", [(16, 16), (33, 70)])
def test_images_have_the_size_asked_for_and_follow_the_generator(shape: tuple[int, int]):
    image, same, other = (
        procedural_image(np.random.default_rng(seed), *shape) for seed in (1, 1, 2)
    )
    assert image.shape == (*shape, 3)
    assert np.array_equal(image, same)
    assert not np.array_equal(image, other)


def test_images_are_neither_flat_nor_saturated_and_differ_in_color():
    images = np.stack([procedural_image(np.random.default_rng(k), 64, 64) for k in range(20)])
    assert images.std(axis=(1, 2, 3)).min() > 10
    assert ((images == 0) | (images == 255)).mean() < 0.3
    assert images.mean(axis=(1, 2)).std(axis=0).min() > 10


def test_spectrum_of_images_falls_about_as_that_of_photographs():
    """Amplitudes of photographs fall as 1 / f^1.0 to 1.3, roughly (Field 1987)."""
    side, slopes = 128, []
    frequency = np.hypot(np.fft.fftfreq(side)[:, None], np.fft.fftfreq(side))
    kept = (frequency > 0.02) & (frequency < 0.4)
    window = np.outer(np.hanning(side), np.hanning(side))
    for k in range(12):
        gray = procedural_image(np.random.default_rng(k), side, side).mean(axis=2)
        amplitude = np.abs(np.fft.fft2((gray - gray.mean()) * window))
        slopes.append(np.polyfit(np.log(frequency[kept]), np.log(amplitude[kept]), 1)[0])
    assert -2.0 < np.mean(slopes) < -0.8
