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

"""
The report of the dynamics node: one status for each of its parts.

``levels`` has the base class of a status; ``inputs``, ``answers`` and ``outcomes`` have the
statuses; ``periodic_report`` puts them together. No module uses ROS or a clock: callers pass
events and their times, in seconds of a steady clock.
"""
