from __future__ import annotations

import inspect

import pytest

from wbplan import mechanism


@pytest.mark.parametrize("name", mechanism.__all__)
def test_public_names_are_documented(name: str) -> None:
    public = getattr(mechanism, name)
    assert (public.__doc__ or "").strip()
    assert not public.__doc__.startswith(f"{name}("), "only what dataclass wrote"
    if inspect.isclass(public):
        for key, value in vars(public).items():
            if not key.startswith("_") and (inspect.isfunction(value) or isinstance(value, property)):
                assert inspect.getdoc(getattr(public, key)), f"{name}.{key}"


def test_public_names_are_sorted_and_there_once() -> None:
    assert list(mechanism.__all__) == sorted(set(mechanism.__all__))
