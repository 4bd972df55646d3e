from __future__ import annotations

import re
from datetime import datetime
from itertools import islice
from pathlib import PurePosixPath, PureWindowsPath

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.errors import InputError
from tsis.files.frame_names import require_file_stem, snapshot_stems, target_folder
from tsis.records import target as bundle
from tsis.sweep import shards

PRINTED = "Target1-020411-131112"  # the source's example: target 1 on 4 February 2011 at 13:11:12


def test_names_are_those_of_the_source() -> None:
    stems = list(islice(snapshot_stems(1, datetime(2011, 2, 4, 13, 11, 12)), 3))
    assert stems == [PRINTED, f"{PRINTED}-2", f"{PRINTED}-3"]


@given(target=st.integers(1, 99_999), when=st.datetimes(datetime(1970, 1, 1), datetime(2068, 12, 31)))
def test_a_name_tells_target_and_time(target: int, when: datetime) -> None:
    stem = next(snapshot_stems(target, when))
    found = re.fullmatch(r"Target(\d+)-(\d{6}-\d{6})", stem)
    assert found is not None
    assert int(found[1]) == target
    assert datetime.strptime(found[2], "%m%d%y-%H%M%S") == when.replace(microsecond=0)


@pytest.mark.parametrize(
    "name", ["../evil", "a/b", "a\\b", "/etc", "..", ".", "", "1st", "a b", "a\n", "CON", "nul", "é", "x" * 41, None, 3]
)
def test_names_with_parts_of_a_path_are_refused(name: object) -> None:
    with pytest.raises(InputError, match="name must be a letter followed"):
        require_file_stem(name)


@given(name=st.text(max_size=60))
def test_an_accepted_name_is_one_part_of_a_path_on_every_system(name: str) -> None:
    try:
        require_file_stem(name)
    except InputError:
        return
    assert PurePosixPath(name).parts == PureWindowsPath(name).parts == (name,)
    assert not PureWindowsPath(name).is_reserved()


@pytest.mark.parametrize("target", [0, -1, 1.5, "1", "../1", float("nan"), True, 10**6])
def test_targets_are_whole_numbers(target: object) -> None:
    with pytest.raises(InputError, match="target must"):
        target_folder(target)


TRICKS = (
    *("..\\up", "C:x", "C:\\x", "\\\\server\\share", "a\\b", "a/b", "../up", "/root", "a:stream", "a.", "a ", "a\0b"),
    *("con", "NUL", "com1", "Lpt9", "aux", "a*", "a?", "a<b", 'a"b', "a|b", ""),
)


@pytest.mark.parametrize("name", TRICKS)
def test_no_name_leads_elsewhere_on_either_system(name: str) -> None:
    """Names that files give to files: of targets and snapshots, in bundles, of a sweep's parts."""
    with pytest.raises(InputError):
        require_file_stem(name)
    assert not any(pattern.fullmatch(f"frames/{name}.png") for pattern in bundle.LARGEST)
    assert shards.NAME.fullmatch(name) is None


@pytest.mark.parametrize("name", ["Target", "a-1_b", "Z" * 40])
def test_good_names_are_one_part_and_no_device_on_windows(name: str) -> None:
    path = PureWindowsPath(require_file_stem(name))
    assert path.parts == (name,)
    assert not path.is_reserved()
