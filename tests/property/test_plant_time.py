"""The plant's future depends on its seed and on what was written when, and on nothing else."""

from hypothesis import example, given, settings
from hypothesis import strategies as st
from small_station import lot_of, plant_of, station_of, write

from stations.plant.hidden.device import Creep, HysteresisPlay

TOTAL_US = 40_000_000
STORY = [  # when, on which device and what is written
    (2_000_000, 3, "set_point", 40.0),
    (5_250_001, 10, "rate", 100.0),
    (5_250_001, 10, "sampling", "running"),
    (TOTAL_US - 3_000_000, 10, "sampling", "stopped"),
]


def drive(cuts, *, look=False, state=None, until=TOTAL_US):
    """A plant taken through the story, its sleeps cut at ``cuts``; everything that can be read at the end."""
    plant = plant_of(station_of(), lot_of(2), hidden=[Creep(), HysteresisPlay()], resume=state)
    begun = plant.now_us
    for time in sorted({*cuts, *(at for at, *_ in STORY), until}):
        if not begun <= time <= until:
            continue
        plant.advance(time - plant.now_us)
        if look:
            everything(plant)
        for at, device_id, name, value in STORY:
            if at == time:
                write(plant, device_id, name, value)
    return plant, everything(plant)


def everything(plant):
    registers = [
        (device_id, r.name, bank.read(r.address, r.words))
        for device_id, bank in plant.banks.items()
        for r in bank.profile.registers
        if r.access != "write"
    ]
    return registers, [plant.sampler.words(unit, 0, 48000) for unit in range(2)]


WHOLE = drive([])[1]


@given(st.lists(st.integers(0, TOTAL_US), max_size=30))
@example(list(range(0, TOTAL_US, 437_003)))
@settings(max_examples=6, deadline=None)
def test_chopped_sleeps_and_looks_leave_no_trace(cuts):
    assert drive(cuts, look=True)[1] == WHOLE


@given(st.integers(5_250_002, TOTAL_US - 3_000_001))
@settings(max_examples=4, deadline=None)
def test_a_resumed_plant_goes_on_bit_for_bit(at):
    plant, _ = drive([], until=at)
    assert drive([], state=plant.journal.state(plant.now_us))[1] == WHOLE


def test_another_seed_is_another_station():
    other = plant_of(station_of(seed=2), lot_of(2))
    other.advance(TOTAL_US)
    assert everything(other)[0] != WHOLE[0]
