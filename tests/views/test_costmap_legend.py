"""The legend's letters and lengths."""

import math

import pytest

from semmap_log.views.costmap_picture import drawable, in_metres, round_length


@pytest.mark.parametrize(
    ("text", "shown"), [("Tür", "Tur"), ("会", "?"), ("a b", "a b"), ("a\nb", "a?b"), ("", "")]
)
def test_letters_that_the_font_does_not_have(text, shown):
    """Without their accents, else as a question mark."""
    assert shown == drawable(text)


@pytest.mark.parametrize(
    ("metres", "length", "said"),
    [(0.9, 1, "1 m"), (1, 1, "1 m"), (1.1, 2, "2 m"), (2.3, 5, "5 m"), (0.06, 0.1, "10 cm"),
     (6, 10, "10 m"), (700, 1000, "1 km"), (0.0006, 0.001, "1 mm")],
)  # fmt: skip
def test_a_scale_bar_has_a_round_length(metres, length, said):
    """1, 2 or 5 of something."""
    assert math.isclose(length, round_length(metres))
    assert said == in_metres(round_length(metres))
