"""Samples per second from one slot to one client, compared with a plain pymodbus loop: `python benchmarks/throughput.py`.

Both read the same full ring buffer of the same simulated reader, a separate process, alternately. The Tumbleline client
carries out a complete transfer of a capture: progress, window, unpacking, check of the sequence numbers, and acknowledgement.
The plain loop reads the same registers with the synchronous client of pymodbus and discards them.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from pymodbus.client import ModbusTcpClient  # noqa: E402

from schemas.lot import Lot, Unit  # noqa: E402
from schemas.station import load_station  # noqa: E402
from stations.codec import WORDS_PER_SAMPLE  # noqa: E402
from stations.devices.registers import Registers  # noqa: E402
from stations.devices.slot import LONGEST_READ, Slot  # noqa: E402
from stations.links.making import Links  # noqa: E402
from stations.profile_files import load_profile  # noqa: E402

RATE_HZ = 4000.0


def serve() -> None:
    """A reader with a full ring, frozen, until its input ends."""
    from stations.opening import make_plant
    from stations.plant.server import PlantServer

    plant = make_plant(load_station(), Lot(units=[Unit(serial="U000", slot=0)], device="ADXL355", seed=1))
    plant.sampler.millihertz = round(1000 * RATE_HZ)
    plant.sampler.start(plant.now_us)
    plant.advance(round(1e6 * plant.sampler.capacity / RATE_HZ))
    plant.sampler.stop()
    with PlantServer(plant) as server:
        print(server.port, flush=True)
        sys.stdin.read()


def bare(client: ModbusTcpClient, device_id: int, samples: int, width: int, address: int) -> float:
    """Duration of a loop that only reads the samples, s."""
    per_read = LONGEST_READ // width
    begun = time.perf_counter()
    for first in range(0, samples, per_read):
        count = min(per_read, samples - first) * width
        answer = client.read_holding_registers(address + first * width, count=count, device_id=device_id)
        if answer.isError():
            sys.exit("the plain loop was refused")
    return time.perf_counter() - begun


def ours(slot: Slot, registers: Registers, samples: int) -> float:
    """Duration of a complete transfer as in a capture, s."""
    begun = time.perf_counter()
    registers.read_group("progress")
    counts = slot._window(0, samples, slot.identity())  # noqa: SLF001 - take() empties the ring buffer once; this reads it again
    registers.write("tail", samples)
    spent = time.perf_counter() - begun
    if len(counts) != samples:
        sys.exit("samples are missing")
    return spent


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=15, help="repetitions of each")
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.serve:
        serve()
        return
    print(f"python benchmarks/throughput.py --rounds {options.rounds}")
    command = [sys.executable, __file__, "--serve"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as server:
        try:
            measure(int(server.stdout.readline()), options.rounds)
        finally:
            server.stdin.close()


def measure(port: int, rounds: int) -> None:
    config, profile = load_station(), load_profile("tumbleline_slot")
    links = Links(config, {"tcp": ("127.0.0.1", port)})
    device_id = config.devices.slots.device_id
    registers = Registers("slot 0", links.registers("slots"), device_id, profile)
    slot, client = Slot(registers), ModbusTcpClient("127.0.0.1", port=port)
    identity, width = slot.identity(), WORDS_PER_SAMPLE[slot.identity().packing]
    samples = int(float(str(registers.read("head"))))
    client.connect()
    times: dict[str, list[float]] = {"bare": [], "ours": []}
    for _ in range(rounds + 1):
        times["bare"].append(bare(client, device_id, samples, width, profile.fifo.address))
        times["ours"].append(ours(slot, registers, samples))
    client.close()
    links.close()
    rate = {name: samples / statistics.median(spent[1:]) for name, spent in times.items()}
    ratios = [b / o for b, o in zip(times["bare"][1:], times["ours"][1:], strict=True)]
    print(
        f"{rounds} turns of {samples} samples of {identity.packing}, {LONGEST_READ // width} per read, median of the repetitions"
    )
    print(f"plain pymodbus loop {rate['bare']:9.0f} samples/s")
    print(
        f"transfer of a slot  {rate['ours']:9.0f} samples/s, {100 * statistics.median(ratios):.0f} % of the plain loop"
    )


if __name__ == "__main__":
    main()
