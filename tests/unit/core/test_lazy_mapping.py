import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenefw.core.lazy_mapping import LazyMapping


@given(st.lists(st.integers()), st.lists(st.integers()))
def test_items_are_those_of_a_dict_and_computed_once_when_asked_for(keys, questions):
    computed = []
    mapping = LazyMapping(keys, lambda key: computed.append(key) or 2 * key)
    assert list(mapping) == list(dict.fromkeys(keys))
    assert len(mapping) == len(set(keys))
    assert all(key in mapping for key in keys)
    assert not computed
    for key in questions:
        if key in mapping:
            assert mapping[key] == 2 * key
        else:
            with pytest.raises(KeyError):
                mapping[key]
    assert computed == [key for key in dict.fromkeys(questions) if key in set(keys)]
    assert dict(mapping) == {key: 2 * key for key in keys}
