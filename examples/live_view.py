# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Example: the hexapod live in a browser, with the use of its drives' limits and its warnings.

It reads ~/markers, which the node makes at visualization_rate (30 Hz) after its answers, and
/diagnostics: no topic at the rate of the setpoints. Needs websockets.

The page is for browsers on this computer: it is served on 127.0.0.1 and by the names of this
computer alone, and only pages that come from there get pictures (no other page in the browser).
"""

import argparse
import asyncio
from http import HTTPStatus
import json
from pathlib import Path
import signal
import sys
import threading

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from stewart_dynamics.messages.received import checked_numbers, ReceivedError, shown_text
from visualization_msgs.msg import Marker, MarkerArray

PAGE = Path(__file__).with_name('live_view.html')
OTHERS = 'platform', 'base', 'singularity', 'names'  # namespaces of markers that are no legs
LEVELS = {DiagnosticStatus.OK: 'OK', DiagnosticStatus.WARN: 'WARN',
          DiagnosticStatus.ERROR: 'ERROR', DiagnosticStatus.STALE: 'STALE'}
MOST_STATUSES = 100
OWN_NAMES = 'localhost', '127.0.0.1', '[::1]'


class View(Node):
    """Keeps the last picture and the last diagnostics as text for the page."""

    def __init__(self) -> None:
        super().__init__('live_view')
        self.statuses: dict[str, list[str]] = {}
        self.text, self.count = '{}', 0
        self.create_subscription(MarkerArray, 'stewart_dynamics/markers', self.on_markers, 1)
        self.create_subscription(DiagnosticArray, '/diagnostics', self.on_diagnostics, 10)

    def on_markers(self, message: MarkerArray) -> None:
        try:
            picture = picture_of({(each.ns, each.id): each for each in message.markers})
        except ReceivedError as exc:
            self.get_logger().warning(f'markers dropped: {exc}', throttle_duration_sec=5.0)
            return
        self.count += 1
        self.text = json.dumps({'count': self.count, **picture, 'statuses': self.statuses})

    def on_diagnostics(self, message: DiagnosticArray) -> None:
        own = f'{self.get_namespace().rstrip("/")}/stewart_dynamics'.lstrip('/')
        for status in message.status:
            node, _, name = shown_text(status.name).partition(': ')
            if node == own and (name in self.statuses or len(self.statuses) < MOST_STATUSES):
                self.statuses[name] = [LEVELS.get(status.level, '?'), shown_text(status.message)]


def picture_of(markers: dict[tuple[str, int], Marker]) -> dict[str, object]:
    """Return the numbers and texts of the page; raise ReceivedError without all of its markers."""
    # The cylinders of which the legs consist: cylinders and pistons, or cranks and rods.
    parts = list(dict.fromkeys(name for name, _ in markers if name not in OTHERS))[:10]
    needed = [('platform', 1), ('base', 1), ('singularity', 0),
              *((part, n) for part in ('names', *parts) for n in range(6))]
    missing = [f'{name} {n}' for name, n in needed if (name, n) not in markers]
    missing += [] if parts else ['legs']
    if missing:
        raise ReceivedError(f'lacks {", ".join(missing)}')

    def points(name: str) -> list[list[float]]:
        numbers = checked_numbers(
            name, [number for p in markers[name, 1].points for number in (p.x, p.y, p.z)], 18)
        return [numbers[n:n + 3] for n in range(0, 18, 3)]

    position, q = markers['platform', 1].pose.position, markers['platform', 1].pose.orientation
    colors = [markers[parts[-1], n].color for n in range(6)]
    return {
        'base': points('base'), 'joints': points('platform'),
        'position': checked_numbers('position', [position.x, position.y, position.z], 3),
        'orientation': checked_numbers('orientation', [q.x, q.y, q.z, q.w], 4),
        'names': [shown_text(markers['names', n].text) for n in range(6)],
        'bodies': [[ends_of(markers[part, n]) for n in range(6)] for part in parts],
        'colors': [checked_numbers('color', [c.r, c.g, c.b], 3, 1.0) for c in colors],
        'text': '\n'.join(map(shown_text, markers['singularity', 0].text.split('\n')[:100]))}


def ends_of(cylinder: Marker) -> list[list[float]]:
    """Return both ends of the axis of a cylinder [m], and its diameter."""
    at, q, size = cylinder.pose.position, cylinder.pose.orientation, cylinder.scale
    x, y, z, w, cx, cy, cz, diameter, length = checked_numbers(
        cylinder.ns, [q.x, q.y, q.z, q.w, at.x, at.y, at.z, size.x, size.z], 9)
    axis = (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y))
    return [*([c + side * length * part for c, part in zip((cx, cy, cz), axis, strict=True)]
              for side in (-0.5, 0.5)), [diameter]]


def is_own(hosts: list[str], origins: list[str]) -> bool:
    """Return whether a request is for this computer by its own name, and from no other page."""
    return (len(hosts) == 1 and hosts[0].rpartition(':')[0] in OWN_NAMES
            and all(origin == f'http://{hosts[0]}' for origin in origins))


async def serve(view: View, port: int, rate: float, ended: threading.Event) -> None:
    """Serve the page, and each new picture to all who look."""
    from websockets.asyncio.server import serve as serve_sockets
    from websockets.exceptions import ConnectionClosed

    def page(connection, request):
        if not is_own(*map(request.headers.get_all, ('Host', 'Origin'))):
            return connection.respond(HTTPStatus.FORBIDDEN, 'for pages of this computer only\n')
        if request.path == '/live':
            return None
        response = connection.respond(HTTPStatus.OK, PAGE.read_text(encoding='utf-8'))
        del response.headers['Content-Type']
        response.headers['Content-Type'] = 'text/html; charset=utf-8'
        return response

    async def show(socket):
        sent = ''
        while not ended.is_set():
            if view.text != sent:
                sent = view.text
                try:
                    await socket.send(sent)
                except ConnectionClosed:
                    return
            await asyncio.sleep(1.0 / rate)

    async with serve_sockets(show, '127.0.0.1', port, process_request=page) as server:
        chosen = server.sockets[0].getsockname()[1]
        print(f'http://127.0.0.1:{chosen}/', flush=True)
        while not ended.is_set():
            await asyncio.sleep(0.1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--port', type=int, default=8765, help='of the page on this computer; 0: '
                        'any that is free')
    parser.add_argument('--rate', type=float, default=30.0, help='largest rate of pictures [Hz]')
    signals: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        # Python's KeyboardInterrupt is lost where it comes within a callback of a C library.
        signal.signal(number, lambda number, frame: signals.append(number))
    # The handlers of rclpy would shut ROS down in the middle of a call.
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as exc:  # bad ROS arguments
        sys.exit(f'live_view: {exc}')
    given = parser.parse_args(remove_ros_args(sys.argv)[1:])
    view, ended, failed = View(), threading.Event(), []

    def run() -> None:
        try:
            asyncio.run(serve(view, given.port, max(given.rate, 0.1), ended))
        except (ImportError, OSError, OverflowError) as exc:
            failed.append(f'live_view: {exc}')

    thread = threading.Thread(target=run)
    thread.start()
    try:
        while not signals and thread.is_alive():
            rclpy.spin_once(view, timeout_sec=0.1)
    finally:  # the server ends with this thread, whatever ends it
        ended.set()
        thread.join()
        view.destroy_node()
        rclpy.shutdown()
    if failed:
        sys.exit(failed[0])


if __name__ == '__main__':
    main()
