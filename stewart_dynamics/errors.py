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

"""What goes wrong by the user's hand; every text says what, where, which value, which rule."""


def one_line(exc: object) -> str:
    """Return what an error says in one line, or its kind where it says nothing."""
    return ' '.join(f'{exc}'.split()) or type(exc).__name__


class StewartError(Exception):
    """The root of all errors that this package raises for its user to read."""


class ParameterError(StewartError):
    """A parameter, or the file it comes from, breaks a rule."""


class MotionError(StewartError):
    """A motion's arrays do not fit each other, or hold what is no pose, twist or acceleration."""


class PoseError(StewartError):
    """Leg lengths that belong to no pose near the one guessed."""


class SingularityError(StewartError):
    """A pose in which no leg forces balance the load."""


class BagError(StewartError):
    """A bag that cannot be read or written."""
