"""Frames against the examples of the Modbus specifications; numbers from their pages."""

import pytest

from stations.links import frames
from stations.links.frames import Malformed, Refused, crc16, read_request, reply_size, values_in, write_request

# Modbus Application Protocol 1.1b3: request, answer and what they mean
READ_COILS = (bytes.fromhex("01 00 13 00 13"), bytes.fromhex("01 03 CD 6B 05"))  # 6.1
READ_DISCRETE = (bytes.fromhex("02 00 C4 00 16"), bytes.fromhex("02 03 AC DB 35"))  # 6.2
READ_HOLDING = (bytes.fromhex("03 00 6B 00 03"), bytes.fromhex("03 06 02 2B 00 00 00 64"))  # 6.3
READ_INPUT = (bytes.fromhex("04 00 08 00 01"), bytes.fromhex("04 02 00 0A"))  # 6.4
WRITE_COIL = (bytes.fromhex("05 00 AC FF 00"), bytes.fromhex("05 00 AC FF 00"))  # 6.5
WRITE_COILS = (bytes.fromhex("0F 00 13 00 0A 02 CD 01"), bytes.fromhex("0F 00 13 00 0A"))  # 6.11
WRITE_REGISTERS = (bytes.fromhex("10 00 01 00 02 04 00 0A 01 02"), bytes.fromhex("10 00 01 00 02"))  # 6.12
EXAMPLES = [READ_COILS, READ_DISCRETE, READ_HOLDING, READ_INPUT, WRITE_COIL, WRITE_COILS, WRITE_REGISTERS]


def test_requests_are_those_of_the_specification():
    assert read_request("coil", 0x13, 19) == READ_COILS[0]
    assert read_request("discrete", 0xC4, 22) == READ_DISCRETE[0]
    assert read_request("holding", 0x6B, 3) == READ_HOLDING[0]
    assert read_request("input", 8, 1) == READ_INPUT[0]
    assert write_request("coil", 0xAC, [1]) == WRITE_COIL[0]
    assert write_request("coil", 0x13, [1, 0, 1, 1, 0, 0, 1, 1, 1, 0]) == WRITE_COILS[0]
    assert write_request("holding", 1, [0x000A, 0x0102]) == WRITE_REGISTERS[0]


def test_answers_mean_what_the_specification_says():
    assert values_in(*READ_HOLDING) == [0x022B, 0x0000, 0x0064]
    assert values_in(*READ_INPUT) == [0x000A]
    coils = values_in(*READ_COILS)  # 27 to 20, then 35 to 28, then 38 to 36
    assert coils[:8][::-1] == [1, 1, 0, 0, 1, 1, 0, 1]
    assert coils[8:16][::-1] == [0, 1, 1, 0, 1, 0, 1, 1]
    assert coils[16:] == [1, 0, 1]
    assert len(values_in(*READ_DISCRETE)) == 22
    for example in (WRITE_COIL, WRITE_COILS, WRITE_REGISTERS):
        assert values_in(*example) == []
    with pytest.raises(Refused) as told:  # 7: example of an exception answer
        values_in(bytes.fromhex("01 04 A1 00 01"), bytes.fromhex("81 02"))
    assert told.value.code == 2


@pytest.mark.parametrize("example", EXAMPLES)
def test_no_cut_or_lengthened_answer_is_an_answer(example):
    request, answer = example
    assert reply_size(request) == len(answer)
    for wrong in [answer[:n] for n in range(len(answer))] + [answer + b"\0"]:
        with pytest.raises((Malformed, Refused)):
            values_in(request, wrong)
    for other in EXAMPLES:  # nor is one to another question
        if other is not example:
            with pytest.raises(Malformed):
                values_in(request, other[1])


def test_the_check_of_a_serial_frame_is_that_of_the_specification():
    # Modbus over serial line 1.02, appendix B: low byte first; the frames as published examples have them
    assert crc16(bytes.fromhex("01 03 00 00 00 0A")) == bytes.fromhex("C5 CD")
    assert crc16(bytes.fromhex("02 07")) == bytes.fromhex("41 12")


def test_bits_come_back():
    for n in (1, 7, 8, 9, 22):
        bits = [(i * 7 + n) % 3 % 2 for i in range(n)]
        assert frames.unpack_bits(frames.pack_bits(bits), n) == bits


def test_the_sign_that_is_asked_for_on_a_serial_line_is_the_example_of_the_specification() -> None:
    """Modbus Application Protocol 1.1b3, 6.8.1: return query data, A537."""
    sign = frames.echo_request(bytes.fromhex("A537"))
    assert sign == bytes.fromhex("080000A537")
    answer = bytes([3]) + sign
    assert frames.ends_with_sign(b"late" + answer + frames.crc16(answer), 3, sign)
    assert not frames.ends_with_sign(answer + frames.crc16(answer), 4, sign)
    assert not frames.ends_with_sign(answer + b"\0\0", 3, sign)
    refusal = bytes([3, 0x88, 1])
    assert frames.ends_with_sign(refusal + frames.crc16(refusal), 3, sign)
    other = bytes([3, 0x83, 1])  # to an earlier read
    assert not frames.ends_with_sign(other + frames.crc16(other), 3, sign)


@pytest.mark.parametrize("space", ["holding", "input", "coil", "discrete"])
@pytest.mark.parametrize("count", [1, 2, 8, 9, 125])
def test_a_read_of_another_size_is_answered_by_nothing_that_answers_the_first(space: str, count: int) -> None:
    request = frames.read_request(space, 100, count)
    other = frames.read_of_other_size(request)
    assert frames.reply_size(other) != frames.reply_size(request)
    assert (other[0], other[1:3]) == (request[0], request[1:3])
