"""The words of messages."""

from rov_fmu.io.messages import listed


def test_words_are_listed_as_in_a_sentence() -> None:
    lists: tuple[list[str], ...] = ([], ["a"], ["a", "b"], ["a", "b", "c"])
    assert [listed(words) for words in lists] == ["", "a", "a and b", "a, b and c"]
