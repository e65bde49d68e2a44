"""What goes onto the wire comes back."""

import math

import numpy as np
import pytest
from each import each
from hypothesis import given
from hypothesis import strategies as st

from schemas.profile import Register
from stations.codec import BITS, OUTPUTS, WORDS_PER_SAMPLE, NotEncodable, decode, encode, pack_samples, unpack_samples

ORDERS = st.sampled_from(["high_first", "low_first", "high_first_swapped", "low_first_swapped"])
RANGES = {
    "uint16": (0, 2**16 - 1),
    "int16": (-(2**15), 2**15 - 1),
    "uint32": (0, 2**32 - 1),
    "int32": (-(2**31), 2**31 - 1),
}


def register(kind, **more):
    return Register.model_validate({"name": "r", "address": 0, "type": kind} | more)


@given(st.sampled_from(sorted(RANGES)), ORDERS, st.data())
def test_integers_come_back(kind, order, data):
    value = data.draw(st.integers(*RANGES[kind]))
    words = encode(register(kind), order, value)
    assert all(0 <= word < 2**16 for word in words)
    assert decode(register(kind), order, words) == value


@given(ORDERS, st.floats(width=32, allow_nan=False))
def test_floats_come_back(order, value):
    assert decode(register("float32"), order, encode(register("float32"), order, value)) == value


@given(ORDERS, st.floats(min_value=-400.0, max_value=400.0))
def test_scaled_values_come_back_within_half_a_step(order, value):
    angle = register("int32", scale=0.001)
    decoded = decode(angle, order, encode(angle, order, value))
    assert isinstance(decoded, float)
    assert abs(decoded - value) <= 0.0005 + 1e-9


@given(ORDERS, st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=20).map(str.strip))
def test_texts_come_back(order, text):
    named = register("string", count=10)
    assert decode(named, order, encode(named, order, text)) == text


@given(ORDERS, st.lists(st.floats(width=32, allow_nan=False, allow_infinity=False), min_size=8, max_size=8))
def test_lists_come_back(order, values):
    eight = register("float32", count=8)
    assert decode(eight, order, encode(eight, order, values)) == values


@given(st.sampled_from(sorted(OUTPUTS)), st.integers(0, 10**6), st.data())
def test_packed_samples_come_back_with_their_numbers(packing, first, data):
    top = 2 ** (BITS[packing] - 1)
    one = st.integers(-top, top - 1)
    rows = st.lists(st.tuples(*[one] * OUTPUTS[packing]), min_size=1, max_size=40)
    counts = np.array(data.draw(rows), dtype=np.int64)
    words = pack_samples(counts, first, packing)
    assert words.shape == (len(counts), WORDS_PER_SAMPLE[packing])
    unpacked, numbers = unpack_samples(words.reshape(-1), packing)
    assert np.array_equal(unpacked, counts)
    assert np.array_equal(numbers, (first + np.arange(len(counts))) % (16 if packing == "int20x3" else 256))


def test_word_order_is_what_it_says():
    orders = ("high_first", "low_first", "high_first_swapped", "low_first_swapped")
    words = [encode(register("float32"), order, 1.0) for order in orders]
    assert words == [[0x3F80, 0], [0, 0x3F80], [0x803F, 0], [0, 0x803F]]


def test_bits_are_bits():
    coils = register("bit", space="coil", count=3)
    assert encode(coils, "high_first", [1.0, 0.0, 1.0]) == [1, 0, 1]
    assert decode(coils, "high_first", [1, 0, 1]) == [1, 0, 1]


@given(st.integers(0, 3), st.integers(-700, 1800))
def test_decimals_of_a_controller_shift_its_values(decimals, tenths):
    value = round(tenths / 10.0, decimals)
    scaled = register("int32").with_decimals(decimals)
    decoded = decode(scaled, "high_first", encode(scaled, "high_first", value))
    assert decoded == pytest.approx(value, abs=1e-9)


REFUSED = [
    ("int16", {}, 40000),
    ("float32", {"minimum": 0.0}, -1.0),
    ("float32", {"maximum": 1.0}, math.nan),
    ("uint16", {"enumeration": {"off": 0}}, "of"),
    ("string", {"count": 2}, "fives"),
    ("float32", {"count": 2}, [1.0]),
    ("bit", {"space": "coil"}, 2),
]


@each(REFUSED)
def test_refuses_what_does_not_fit(row):
    kind, more, value = row
    with pytest.raises(NotEncodable):
        encode(register(kind, **more), "high_first", value)
