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

"""The messages of the simulator, as another library reads them."""

from __future__ import annotations

from messages import STORE
from simulated import simulated

from stewart_dynamics.simulator.messages import OUTPUT_TYPES, StateMessages
from stewart_dynamics.simulator.plant import Plant


def test_messages_have_the_state() -> None:
    plant = Plant(simulated(base_frame='ground', joints=list('abcdef'), geometry__zero_length=0.9))
    state = plant.advance(
        (500.0, 400.0, 300.0, 200.0, 100.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    written = dict(StateMessages(plant.parameters).write(12_000_000_034, state))
    assert list(written) == list(OUTPUT_TYPES)
    of = {topic: STORE.deserialize_cdr(data, OUTPUT_TYPES[topic])
          for topic, data in written.items()}
    for each in of.values():
        assert (each.header.stamp.sec, each.header.stamp.nanosec) == (12, 34)
    assert {of[topic].header.frame_id for topic in ('pose', 'twist', 'accel')} == {'ground'}
    legs, pose = of['leg_states'], of['pose'].pose
    assert legs.name == list('abcdef')
    assert legs.position.tolist() == [length - 0.9 for length in state.lengths]
    assert legs.velocity.tolist() == list(state.rates)
    assert legs.effort.tolist() == [500.0, 400.0, 300.0, 200.0, 100.0, 0.0]
    position, q = pose.position, pose.orientation
    assert (position.x, position.y, position.z, q.x, q.y, q.z, q.w) == state.pose
    for vectors, values in ((of['twist'].twist, state.twist),
                            (of['accel'].accel, state.acceleration)):
        assert values == tuple(getattr(vector, axis) for vector in (vectors.linear,
                                                                    vectors.angular)
                               for axis in 'xyz')
