"""Pixels to map values: each server's C++ loop, read line by line, says the same of every pixel."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semmap_log.analysis.costmap_2d.map_rules import MODES, RULES, MapRules
from semmap_log.errors import CostmapError

GREYS = np.arange(256, dtype=np.uint8)[None]


def c_round(number):
    """C's round(): halves away from zero; of numbers that are not negative."""
    return math.floor(number + 0.5)


def int8(byte):
    return byte - 256 if byte > 127 else byte


def noetic(pixel, rules, *, alpha_mask):
    """image_loader.cpp's inner loop; `pixel` is the bytes of one pixel as SDL has them."""
    n_channels = len(pixel)
    avg_channels = n_channels if rules.mode == "trinary" or not alpha_mask else n_channels - 1
    color_avg = sum(pixel[:avg_channels]) / float(avg_channels)
    alpha = 1 if n_channels == 1 else pixel[-1]
    if rules.negate:
        color_avg = 255 - color_avg
    if rules.mode == "raw":
        return int8(int(color_avg))
    occ = (255 - color_avg) / 255.0
    if occ > rules.occupied_thresh:
        return 100
    if occ < rules.free_thresh:
        return 0
    if rules.mode == "trinary" or alpha < 1.0:
        return -1
    ratio = (occ - rules.free_thresh) / (rules.occupied_thresh - rules.free_thresh)
    return int8(int(1 + 98 * ratio))


def nav2(pixel, rules, *, alpha_mask):
    """map_io.cpp since pull request 5071, for one pixel of one byte, three, or three and alpha."""
    f32 = np.float32
    if len(pixel) >= 3:
        red, green, blue = (257 * channel for channel in pixel[:3])
        byte = math.floor(0.299 * red + 0.587 * green + 0.114 * blue + 0.5) // 257
    else:
        byte = pixel[0]
    if rules.mode == "raw":
        return byte if int8(byte) >= 0 and byte <= 100 else -1
    normalized = f32(byte) / f32(255.0)
    if not rules.negate:
        normalized = f32(1.0) - normalized
    result = -1
    if normalized >= f32(rules.occupied_thresh):
        result = 100
    if normalized <= f32(rules.free_thresh):
        result = 0
    if rules.mode == "scale" and f32(rules.free_thresh) < normalized < f32(rules.occupied_thresh):
        span = f32(rules.occupied_thresh - rules.free_thresh)
        result = c_round(float((normalized - f32(rules.free_thresh)) / span * f32(100.0)))
    return -1 if alpha_mask and pixel[-1] < 255 else result


def nav2_humble(pixel, rules, *, alpha_mask):
    """map_io.cpp before it; quanta are 16 bits."""
    grey = len(pixel) == 1
    channels = [257 * c for c in (pixel * 3 if grey else pixel[:3])]
    if rules.mode == "trinary" and alpha_mask:
        channels.append(257 * pixel[-1])
    shade = sum(channels) / len(channels) / 65535.0
    occ = shade if rules.negate else 1.0 - shade
    if rules.mode == "raw":
        byte = c_round(shade * 255)
        return byte if byte <= 100 else -1
    if rules.mode == "scale" and alpha_mask and pixel[-1] != 255:
        return -1
    if rules.occupied_thresh < occ:
        return 100
    if occ < rules.free_thresh:
        return 0
    if rules.mode == "trinary":
        return -1
    span = rules.occupied_thresh - rules.free_thresh
    return round((occ - rules.free_thresh) / span * 100.0)


PORTS = {"noetic": noetic, "nav2": nav2, "nav2_humble": nav2_humble}

shares = st.integers(0, 255).map(lambda byte: byte / 255)
backwards = st.integers(0, 255).map(lambda byte: 1 - byte / 255)
thresholds = st.lists(
    shares | backwards | st.floats(0, 1) | st.sampled_from([0.0, 0.196, 0.25, 0.65, 0.8, 1.0]),
    min_size=2, max_size=2, unique=True,
).map(sorted)  # fmt: skip
"""Often just the occupancy of a byte: there the servers differ."""


@pytest.mark.parametrize("rules", RULES)
@pytest.mark.parametrize("mode", MODES)
@settings(deadline=None)
@given(thresh=thresholds, negate=st.booleans())
def test_every_byte_of_grey_means_what_the_server_says(rules, mode, thresh, negate):
    """All 256, in every mode, negated and not, with any thresholds."""
    how = MapRules(rules, mode, negate, occupied_thresh=thresh[1], free_thresh=thresh[0])

    found = how.cells(GREYS)

    expected = [[PORTS[rules]([byte], how, alpha_mask=False) for byte in range(256)]]
    assert expected == found.tolist()
    assert np.int8 == found.dtype


@pytest.mark.parametrize("rules", RULES)
@pytest.mark.parametrize("mode", MODES)
@settings(deadline=None)
@given(
    thresh=thresholds,
    negate=st.booleans(),
    pixels=st.lists(
        st.tuples(*[st.sampled_from([0, 1, 254, 255]) | st.integers(0, 255)] * 4),
        min_size=1, max_size=20,
    ),
)  # fmt: skip
@pytest.mark.parametrize("alpha", [True, False])
def test_every_colour_means_what_the_server_says(rules, mode, alpha, **drawn):
    """With and without transparency."""
    thresh, negate, pixels = drawn["thresh"], drawn["negate"], drawn["pixels"]
    how = MapRules(rules, mode, negate, occupied_thresh=thresh[1], free_thresh=thresh[0])
    picture = [pixel if alpha else pixel[:3] for pixel in pixels]

    found = how.cells(np.array([picture], np.uint8), alpha=alpha)

    expected = [[PORTS[rules](pixel, how, alpha_mask=alpha) for pixel in picture]]
    assert expected == found.tolist()


@pytest.mark.parametrize(
    ("rules", "cells"),
    [("noetic", [[-1, -1]]), ("nav2", [[0, 100]]), ("nav2_humble", [[0, -1]])],
)
def test_a_pixel_on_a_threshold(rules, cells):
    """204 is an occupancy of 0.2, 51 of 0.8: whether a threshold counts differs by server."""
    how = MapRules(rules, occupied_thresh=0.8, free_thresh=0.2)

    assert cells == how.cells(np.array([[204, 51]], np.uint8)).tolist()


def test_every_value_of_sixteen_bits():
    """noetic takes the high byte, Nav2 all of 257 steps."""
    deep = np.arange(65536, dtype=np.uint16).reshape(256, 256)

    def of(rules, pixels):
        return MapRules(rules, "scale", occupied_thresh=0.9, free_thresh=0.1).cells(pixels)

    assert np.array_equal(of("noetic", (deep >> 8).astype(np.uint8)), of("noetic", deep))
    assert np.array_equal(of("nav2", (deep // 257).astype(np.uint8)), of("nav2", deep))
    exact = of("nav2_humble", deep)[:, 0]
    assert 100 == exact[0]
    assert np.all(np.diff(exact.astype(int)) <= 0)


def test_noetic_s_two_channels_without_a_mask():
    """Grey with a transparent colour comes from SDL as two bytes, both counted as shades."""
    pixels = np.array([[[0, 255], [0, 0]]], np.uint8)

    assert [[-1, 100]] == MapRules("noetic").cells(pixels).tolist()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"rules": "melodic"}, "rules: expected one of noetic, nav2, nav2_humble, got 'melodic'"),
        ({"mode": "ternary"}, "mode: expected one of trinary, scale, raw, got 'ternary'"),
        ({"free_thresh": 0.7}, "free_thresh <= occupied_thresh <= 1, got 0.7 and 0.65"),
        ({"occupied_thresh": 65.0}, "<= 1, got 0.196 and 65.0"),
        ({"free_thresh": -0.1}, "expected 0 <= free_thresh"),
        ({"free_thresh": math.nan}, "got nan and 0.65"),
        ({"mode": "scale", "free_thresh": 0.65}, "below occupied_thresh in mode scale"),
    ],
)
def test_rules_that_cannot_be(given, message):
    """One wrong value each."""
    with pytest.raises(CostmapError, match=message):
        MapRules(**{"rules": "nav2", **given})
