"""Lines of the keys of a TOML file."""

from hypothesis import given
from hypothesis import strategies as st

from kinertia.io.text.toml_lines import TomlFile


@given(
    st.lists(
        st.tuples(st.booleans(), st.lists(st.sampled_from(["a", "b-c", "d_1"]), unique=True), st.integers(0, 2)),
        max_size=6,
    )
)
def test_locator_finds_every_key(tables):
    text, expected, counts = [], {}, {}
    for number, (array, keys, blank) in enumerate(tables):
        name = "trial" if array else f"t{number}"
        place = (name, counts.setdefault(name, 0)) if array else (name,)
        counts[name] = counts.get(name, 0) + 1
        text += [""] * blank + [f"[[ {name} ]]  # x" if array else f"[{name}]"]
        expected[place] = len(text)
        for key in keys:
            text += [f"  {key} = [1,", "   2]"]
            expected[(*place, key)] = len(text) - 1
    document = TomlFile("\n".join(text), {})
    for place, line in expected.items():
        assert document.line(place) == line
    assert document.line(("nowhere", 1)) is None
