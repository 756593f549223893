"""A discrete-event simulation of the farm: its scheduling, on a clock that does not run.

The blocks are those of `gen.generation.run.blocks_of`, the number in flight is
`gen.runtime.farm.IN_FLIGHT`. The master is one server (its two threads share one interpreter) with
two things to do in turn:

- messages: receive a block's rows from a worker and send it the next task that waits, if one does;
- turns of the farm's loop: write one block that has come, then top up the tasks in flight.

A worker is idle from the end of its block until the message with its next task arrives.
"""

import heapq
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bench.scale.costs import Costs
from gen.generation.delivery import Block
from gen.runtime.farm import IN_FLIGHT

Writer = Literal["master", "workers", "nobody"]


@dataclass(frozen=True)
class Outcome:
    """How a simulated run went."""

    makespan: float  # from the first task handed out to the last row written [s]
    efficiency: float  # the rows' own time over that of all workers [1]
    tail: float  # mean time of a worker between its last block and the end, over the makespan [1]
    busy: float  # share of the makespan in which the master works [1]
    blocks: int
    waiting_rows: int  # most rows that the master held, received but not written


def simulate(
    blocks: Iterable[Block],
    seconds: NDArray[np.float64],
    workers: int,
    costs: Costs,
    *,
    write: Writer,
) -> Outcome:
    """Let simulated workers do the blocks in their order, given the time of each row [s].

    The master writes, or the workers at the same cost, or nobody.
    """
    return _Farm(iter(blocks), seconds, workers, costs, write).run()


class _Farm:
    """The state of a simulated run."""

    def __init__(
        self,
        blocks: Iterator[Block],
        seconds: NDArray[np.float64],
        workers: int,
        costs: Costs,
        write: Writer,
    ) -> None:
        self._tasks = blocks
        self._until = np.concatenate([[0.0], np.cumsum(seconds)])
        self._workers, self._costs, self._write = workers, costs, write
        self._now = self._work = 0.0
        self._in_flight = self._blocks = self._held = self._most_held = 0
        self._drained = False
        self._queue: deque[Block] = deque()  # submitted, waiting for a worker
        self._idle: deque[int] = deque(range(workers))
        self._arrivals: list[tuple[float, int, Block]] = []  # a heap: when, from whom, what
        self._received: deque[Block] = deque()  # futures that are done
        self._last = np.zeros(workers)
        self._send = 0.5 * costs.message.fixed  # of the two messages, tasks are the short one
        # What a worker waits beyond the master's own work: the way of two messages, and polling.
        self._way = max(costs.gap - costs.message(1), 0.0) / 2

    def run(self) -> Outcome:
        self._top_up()
        message_next = True
        while self._in_flight:
            arrived = bool(self._arrivals) and self._arrivals[0][0] <= self._now
            if arrived and (message_next or not self._received):
                self._receive()
                message_next = False
            elif self._received:
                self._take()
                message_next = True
            else:
                self._now = self._arrivals[0][0]
        span = self._now
        return Outcome(
            makespan=span,
            efficiency=float(self._until[-1]) / (span * self._workers),
            tail=float(np.mean(span - self._last)) / span,
            busy=self._work / span,
            blocks=self._blocks,
            waiting_rows=self._most_held,
        )

    def _spend(self, seconds: float) -> None:
        self._now += seconds
        self._work += seconds

    def _receive(self) -> None:
        """Take a message from a worker, and give it the next task."""
        _, worker, block = heapq.heappop(self._arrivals)
        rows = block[1] - block[0]
        # Where the workers write, a message says how many rows there were, not what is in them.
        self._spend(self._costs.message(0 if self._write == "workers" else rows) - self._send)
        self._received.append(block)
        self._held += rows
        self._most_held = max(self._most_held, self._held)
        self._idle.append(worker)
        self._hand_out()

    def _take(self) -> None:
        """Write one block, and hand in new tasks."""
        start, stop = self._received.popleft()
        self._spend(self._costs.bookkeeping(self._workers))
        if self._write == "master":
            self._spend(self._costs.write(stop - start))
        self._held -= stop - start
        self._in_flight -= 1
        self._top_up()

    def _top_up(self) -> None:
        """Draw tasks until enough are in flight."""
        while not self._drained and self._in_flight < IN_FLIGHT * self._workers:
            block = next(self._tasks, None)
            if block is None:
                self._drained = True
                break
            self._in_flight += 1
            self._blocks += 1
            self._queue.append(block)
        self._hand_out()

    def _hand_out(self) -> None:
        """Send waiting tasks to idle workers."""
        while self._queue and self._idle:
            self._spend(self._send)
            worker, (start, stop) = self._idle.popleft(), self._queue.popleft()
            duration = float(self._until[stop] - self._until[start])
            if self._write == "workers":
                duration += self._costs.write(stop - start)
            ended = self._now + self._way + duration
            self._last[worker] = ended
            heapq.heappush(self._arrivals, (ended + self._way, worker, (start, stop)))
