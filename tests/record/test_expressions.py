"""Expressions of columns: what they give, and what is refused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.record.expressions import Expression, parts_of
from tests.examples import examples

NAMES = ("t", "x", "cmd", "cmd-x", "x [mm]", "a, b", "log.t", "data[2]", "-", "2", "e")
COLUMNS = {f"#{place + 1}": place for place in range(len(NAMES))} | {
    name: place for place, name in enumerate(NAMES)
}
VALUES = [10.0 * place + np.arange(3.0) for place in range(len(NAMES))]


def value_of(text: str) -> list[float]:
    expression = Expression.read("log.csv", text, COLUMNS)
    return np.asarray(expression.value([VALUES[place] for place in expression.places])).tolist()


@pytest.mark.parametrize(
    ("text", "first", "bare"),
    [
        ("x", 10.0, True),
        (" x [mm] ", 40.0, True),
        ("'a, b'", 50.0, True),
        ("#2", 10.0, True),
        ("2", 90.0, True),
        ("cmd-x", 30.0, True),
        ("cmd - x", 10.0, True),
        ("cmd-x*2", 60.0, False),
        ("x [mm]*1e-3", 0.04, False),
        ("data[2]-log.t", 10.0, True),
        ("-(x+1)/#1", -np.inf, False),
        ("1e-3*e", 0.1, False),
        ("2.5 * x", 25.0, False),
        ("'2'*2", 180.0, False),
        ("x*-2", -20.0, False),
        ("cumsum(x)*2", 20.0, False),
    ],
)
def test_an_expression_has_the_value_of_its_columns(text: str, first: float, bare: bool) -> None:
    assert value_of(text)[0] == pytest.approx(first)
    assert Expression.read("log.csv", text, COLUMNS).bare is bare


def test_a_counter_is_unwrapped_over_cells_without_a_number() -> None:
    counter = np.array([65534.0, 65535.0, np.nan, 1.0, 2.0])
    expression = Expression.read("log.csv", "unwrap(n, 65536)*2", {"n": 0})
    expected = [131068.0, 131070.0, np.nan, 131074.0, 131076.0]
    assert np.array_equal(expression.value([counter]), expected, equal_nan=True)


@pytest.mark.parametrize(
    "text",
    ["", "x**2", "x if x else t", "x.real", "(x).real", "__import__('x')", "unwrap(x)", "x[0]",
     "unwrap(x, x)", "unwrap(x, 0)", "unwrap(x, 1, 2)", "(" * 900, "x,t", "'x", "1j", "True",
     "x*", "[x]", "lambda: x", "x" * 2000, "\0", "\ud800"],
)  # fmt: skip
def test_what_is_no_expression_is_refused_in_a_sentence(text: str) -> None:
    with pytest.raises(InvalidInputError) as refused:
        value_of(text)
    assert str(refused.value).startswith("log.csv")
    assert len(str(refused.value)) < 1000


def test_a_name_that_is_not_there_is_named() -> None:
    with pytest.raises(InvalidInputError, match="has no column 'cmdd'; did you mean cmd"):
        value_of("cmdd - x")


def test_a_list_is_split_at_commas_outside_of_brackets_and_quotes() -> None:
    parts = ["time=t", "position=unwrap(n, 256)", "force='F, N)'*2", "velocity=data[1]"]
    assert parts_of(",".join(parts)) == parts


@examples(quick=200, thorough=500, deadline=None)
@given(st.text(alphabet="xt#12.+-*/()'\"e, unwrap[]", max_size=30))
def test_any_text_has_a_value_or_is_refused(text: str) -> None:
    try:
        value = value_of(text)
    except InvalidInputError:
        return
    assert np.ndim(value) <= 1
