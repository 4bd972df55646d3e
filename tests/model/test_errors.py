from __future__ import annotations

import inspect

from tsis import errors


def test_every_error_is_drawn_in_the_tree_and_descends_from_the_root() -> None:
    classes = [
        member for _, member in inspect.getmembers(errors, inspect.isclass) if member.__module__ == errors.__name__
    ]
    assert len(classes) >= 9
    for member in classes:
        assert issubclass(member, (errors.TsisError, errors.TsisWarning))
        assert member.__name__ in str(errors.__doc__)


def test_errors_are_caught_by_the_built_in_kind_a_caller_expects() -> None:
    assert issubclass(errors.FileInputError, ValueError)
    assert issubclass(errors.MissingExtraError, ImportError)
