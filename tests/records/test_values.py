"""What a press or a target cannot be, none is."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from tests.records.sample import sample_record

from tsis.errors import InputError
from tsis.files.json_values import to_json_value


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"frame": "../etc/passwd"}, "frame must be the SHA-256 of a stored file"),
        ({"frame": "0" * 64 + "\n"}, "frame must be the SHA-256 of a stored file"),
        ({"rows": 0}, r"rows must lie in \[1, 65535\]; got 0"),
        ({"columns": 2.5}, "columns must be a whole number"),
        ({"force_n": 1e9}, r"force_n must lie in \[0, 100\]"),
        ({"force_n": float("nan")}, "force_n must lie in"),
        ({"mm_per_pixel": (0.1, 40.0)}, "mm_per_pixel must lie in"),
        ({"full_scale": 0.0}, "full_scale must lie in"),
        ({"axis_px": (float("inf"), 0.0)}, "axis_px must be finite"),
    ],
)
def test_a_press_out_of_range_is_refused(values: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        replace(sample_record().presses[0], **values)


@pytest.mark.parametrize("name", ["", " ", "\x1b[31mred", "two\nlines", "d" * 201, 1])
def test_a_true_value_has_a_name_that_can_be_shown(name: Any) -> None:
    with pytest.raises(InputError, match="a name in truth must be 1 to 200 printable characters"):
        replace(sample_record().target, truth={name: 1.0})


def test_numbers_of_targets_end_where_names_of_folders_do() -> None:
    given = sample_record().target
    assert replace(given, number=99_999).number == 99_999
    with pytest.raises(InputError, match=r"number must lie in \[1, 99999\]; got 100000"):
        replace(given, number=100_000)


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"options": {"prior": 5}}, r"options\['prior'\] must be a mapping"),
        ({"environment": {"libraries": ["numpy"]}}, r"environment\['libraries'\] must be a mapping"),
    ],
)
def test_what_recomputing_could_not_read_is_refused(values: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        replace(sample_record().estimates[0], **values)


def test_letters_that_join_others_may_be_in_a_name() -> None:
    family = "\U0001f468\u200d\U0001f469\u200d\U0001f467 \u0645\u06cc\u200c\u062e\u0648\u0627\u0647\u0645"
    assert replace(sample_record().target, name=family).name == family


def test_half_a_letter_in_settings_is_refused() -> None:
    with pytest.raises(InputError, match=r"settings\.maker must be text that UTF-8 can hold"):
        to_json_value(replace(sample_record().presses[0], settings={"maker": "half \ud800"}))
