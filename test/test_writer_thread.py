# Copyright 2026 The stewart_dynamics developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The thread that writes files."""

from __future__ import annotations

from threading import Event, Thread
import time

import pytest
from stewart_dynamics.replay.writer_thread import WriterThread


def test_calls_are_made_in_their_order() -> None:
    thread, done = WriterThread(), list[int]()
    for n in range(100):
        thread.call(done.append, n)
    thread.finish()
    assert done == list(range(100))


def test_a_call_waits_while_earlier_ones_are_not_done() -> None:
    thread, go, called = WriterThread(), Event(), list[int]()

    def call_many() -> None:
        for n in range(10):
            thread.call(go.wait)
            called.append(n)

    caller = Thread(target=call_many)
    caller.start()
    while len(called) < 2:
        time.sleep(0.001)
    caller.join(0.05)
    assert len(called) == 2  # memory is bounded
    go.set()
    caller.join()
    thread.finish()


def test_an_error_is_raised_by_the_next_calls_and_ends_the_work() -> None:
    thread, done = WriterThread(), list[int]()
    with pytest.raises(ZeroDivisionError):
        for n in range(-5, 100):
            thread.call(lambda n=n: done.append(1 // n))
    with pytest.raises(ZeroDivisionError):
        thread.finish()
    assert len(done) == 5
    thread.abandon()


def test_abandoned_calls_are_not_made() -> None:
    thread, go, done = WriterThread(), Event(), list[int]()
    thread.call(go.wait)
    thread.call(done.append, 1)
    leaver = Thread(target=thread.abandon)
    leaver.start()
    leaver.join(0.05)
    assert leaver.is_alive()
    go.set()
    leaver.join()
    assert not done
