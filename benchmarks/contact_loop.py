"""One product K u against its bounds: copying its bytes, and adding at both ends of contacts.

Each round copies as many bytes as a product needs, from arrays that no cache holds. Then it
computes the product twice: the first time with empty caches, the second time as in a recurrence.
Finally it goes twice through the same contacts and only adds at both ends, without springs: every
loop over contacts must do at least that. Other programs on the machine slow all of them alike.
"""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.harness import diagram
from benchmarks.harness.measure import CORES, Job
from benchmarks.harness.packing import bytes_of, sample_or_small
from benchmarks.harness.report import Page
from modal.packing.network import Network, read_network
from modal.system.contact_order import OrderedContacts
from modal.system.operator import ContactOperator
from modal.tools.arrays import Ints
from modal.tools.errors import InputError
from modal.tools.loops import numba, prange, threads_for

TITLE = "One product K u against copying its bytes and against adding at the ends of the contacts"
ROUNDS = {True: 5, False: 400}
COPIED_BYTES = 256_000_000
"""Bytes of each array that is copied in parts: more than a cache holds."""
TIMED = ("product", "first product", "additions", "copy")
"""Timed calls: the second of two products, the first one, the second of two loops that only add,
and the copy."""


def numbered(network: Network, old: Ints) -> Network:
    """Renumber the spheres of a packing: sphere i was `old[i]` before, (n,)."""
    new = np.argsort(old)
    j = network.particle_j
    ends = {"particle_i": new[network.particle_i], "particle_j": np.where(j < 0, j, new[j])}
    same = {k: getattr(network, k)[old] for k in ("position", "radius", "mass", "inertia")}
    return replace(network, **same, **ends)


def _add_at_both_ends(x, y, rows, ends, starts, threads):
    """Set y[i] -= p, y[j] += p for p = (x[i] + x[j]) times six numbers of the contact; (n, 6)."""
    for odd in range(2):
        for thread in prange(threads):
            for slab in range(2 * int(thread) + odd, len(starts) - 1, 2 * threads):
                for c in range(starts[slab], starts[slab + 1]):
                    i = ends[c, 0]
                    j = ends[c, 1] if ends[c, 1] >= 0 else i  # a wall has no motion to add to
                    for d in range(6):
                        p = rows[c, d] * (x[i, d] + x[j, d])
                        y[i, d] -= p
                        y[j, d] += p


def _copy(source, target, threads):
    part = len(source) // threads
    for thread in prange(threads):
        first = int(thread) * part
        target[first : first + part] = source[first : first + part]


def by_turns(path: str, rounds: int) -> Callable[[], dict[str, Any]]:
    """Prepare the task that returns seconds (4, rounds) of `TIMED`, bytes and threads."""
    if numba is None:
        raise InputError(
            "no_numba", "the loop over contacts needs numba", remedy="install it, or leave this out"
        )
    network = read_network(path)
    operator = ContactOperator(network)
    contacts = OrderedContacts.from_network(network, "none")
    threads = threads_for(network.n_particles)
    starts = contacts.pieces[contacts.slabs, 0]
    needs = bytes_of(operator)
    add = numba.njit(_add_at_both_ends, parallel=True, fastmath=True)
    copy = numba.njit(_copy, parallel=True, fastmath=True)
    u = np.random.default_rng(1).standard_normal((network.n_particles, 6))
    out = np.zeros_like(u)
    sums = np.zeros_like(u)
    # A copy reads and writes each of its numbers, of 8 bytes, once.
    length = int(needs) // 16
    source, target = np.ones((2, max(COPIED_BYTES // 8, length)))

    def time_call(function: Callable[..., object], *arguments: Any) -> float:
        start = time.perf_counter()
        function(*arguments)
        return time.perf_counter() - start

    def time_product() -> float:
        return time_call(operator.combine, u.ravel(), out.ravel(), 1.0, 0.0, 1.0)

    def time_additions() -> float:
        return time_call(add, u, sums, contacts.rows, contacts.ends, starts, threads)

    def time_round(k: int) -> list[float]:
        first = k * length % max(1, len(source) - length)
        last = first + length
        copying = time_call(copy, source[first:last], target[first:last], threads)
        first_product = time_product()
        second_product = time_product()
        time_additions()
        return [second_product, first_product, time_additions(), copying]

    time_round(0)  # compiles

    def action() -> dict[str, Any]:
        seconds = np.array([time_round(k) for k in range(rounds)]).T
        return {"seconds": seconds.tolist(), "threads": threads, "bytes": needs}

    return action


def row_of(numbering: str, value: dict[str, Any]) -> dict[str, Any]:
    """Return medians and quartiles of the seconds of one task, in ms, and ratios of medians."""
    row: dict[str, Any] = {"numbering": numbering, "threads": value["threads"]}
    row["mb"] = value["bytes"] / 1e6
    low, middle, high = 1e3 * np.quantile(value["seconds"], (0.25, 0.5, 0.75), axis=1)
    for k, name in enumerate(TIMED):
        row |= {f"{name}, ms": middle[k], f"{name}, quarter below": low[k]}
        row |= {f"{name}, quarter above": high[k]}
    product, _, additions, copy = middle
    row |= {"times additions": product / additions, "times copy": product / copy}
    return row | {"additions, times copy": additions / copy}


def run(job: Job) -> Page:
    """Measure with spheres numbered as in the sample, along z and at random, on 1 and all cores."""
    sample = sample_or_small(500, job.quick)
    rounds = ROUNDS[job.quick]
    n = sample.n_particles
    rows: list[dict[str, Any]] = []
    orders = {
        "as in the sample": np.arange(n),
        "along z": np.argsort(sample.position[:, 2], kind="stable"),
        "at random": np.random.default_rng(1).permutation(n),
    }
    for numbering, old in orders.items():
        path = job.write(numbered(sample, old))
        for threads in (1, CORES):
            run = job.measured(by_turns, threads=threads, path=path, rounds=rounds)
            rows.append(row_of(numbering, run.value))
    task = (
        f"One product K u of {n} spheres with {sample.n_contacts} contacts, by turns with a copy "
        "of as many bytes and with a loop that only adds at both ends of each contact; medians of "
        f"{rounds} rounds by the clock, and the quarters below and above. The first product "
        "comes right after the copy; products and additions are those right after the first."
    )
    names = [f"{row['numbering']}, {row['threads']} threads" for row in rows]
    remarks = [
        f"Spheres numbered {name}: {row['product, ms']:.2f} ms, {row['times copy']:.1f} times a "
        f"copy of its {row['mb']:.1f} MB; {row['times additions']:.2f} times the additions alone, "
        f"which take {row['additions, times copy']:.1f} times the copy."
        for name, row in zip(names, rows, strict=True)
    ]
    series = {name: [{"ms": row[f"{name}, ms"]} for row in rows] for name in TIMED}
    figure, ax = diagram.bars(names, series, "ms")
    ax.set(xlabel="median (ms)")
    diagram.legend_below(figure, ax)
    return Page(TITLE, task, {"contact_loop": rows}, remarks, {"contact_loop": figure})
