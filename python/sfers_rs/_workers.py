"""Processes that predict runs of a plant, each with a copy of it."""

from __future__ import annotations

import multiprocessing
import pickle
import queue
import signal
import sys
import threading
from multiprocessing.connection import Connection
from typing import Any

from ._described import Described
from .plant import PredictionError


def _work(described: Described, line: Connection, copied: list[Connection]) -> None:
    # The caller's ends of all lines: while a copy of one is open, its other end does not hear that the caller has ended.
    for end in copied:
        end.close()
    # Ctrl-C goes to all processes of a terminal; the caller's ends these.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    while True:
        try:
            request = line.recv()
        except EOFError:
            return
        try:
            line.send((True, described.predict(*request)))
        except Exception as error:
            # As text: not every exception can be sent.
            line.send((False, str(error)))


def _context(described: Described) -> Any:
    """Fork where this is safe, else a new interpreter, to which the plant has to be sent."""
    # A copy of a process has one thread only: what the others had locked stays so.
    if "fork" in multiprocessing.get_all_start_methods() and threading.active_count() == 1:
        return multiprocessing.get_context("fork")
    main = sys.modules["__main__"]
    if type(described.plant).__module__ == "__main__" and not hasattr(main, "__file__"):
        raise ValueError(
            f"{type(described.plant).__name__} is defined in a notebook, where other processes do not find it: "
            "put it into a module, or use parallel=\"threads\" or jobs=1"
        )
    try:
        pickle.dumps(described)
    except Exception as error:
        raise ValueError(f"the plant cannot be sent to other processes ({error}); use parallel=\"threads\" or jobs=1") from error
    return multiprocessing.get_context("spawn")


class Workers:
    """A number of processes, of which each predicts one run at a time. To be closed."""

    def __init__(self, described: Described, count: int):
        context = _context(described)
        self._idle: queue.SimpleQueue[tuple[Any, Connection]] = queue.SimpleQueue()
        self._all: list[tuple[Any, Connection]] = []
        for _ in range(count):
            ours, theirs = context.Pipe()
            ends = [line for _, line in self._all] + [ours] if context.get_start_method() == "fork" else []
            process = context.Process(target=_work, args=(described, theirs, ends), daemon=True)
            process.start()
            # Its death is then the end of the line.
            theirs.close()
            self._all.append((process, ours))
            self._idle.put((process, ours))

    def predict(self, *request: Any) -> Any:
        """As :meth:`Described.predict`, by an idle process."""
        process, line = self._idle.get()
        try:
            line.send(request)
            is_prediction, answer = line.recv()
        except (EOFError, OSError):
            process.join(1.0)
            raise PredictionError(f"the process that predicted run {request[0]} ended with code {process.exitcode}") from None
        finally:
            self._idle.put((process, line))
        if not is_prediction:
            raise PredictionError(answer)
        return answer

    def close(self) -> None:
        """Ends the processes, whatever they do."""
        for process, _ in self._all:
            process.terminate()
        for process, _ in self._all:
            process.join(5.0)
            if process.is_alive():
                process.kill()
                process.join()
        # The lines are closed with this object: threads may still wait for what they end with.
        self._all = []
