# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Example: the hexapod live in a browser, with the use of its force limits and its warnings.

It reads ~/markers, which the node makes at visualization_rate (30 Hz) after its answers, and
/diagnostics: no topic at the rate of the setpoints. Needs websockets.
"""

import argparse
import asyncio
from http import HTTPStatus
import json
from pathlib import Path
import signal
import sys
import threading

from diagnostic_msgs.msg import DiagnosticArray
import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from visualization_msgs.msg import MarkerArray

PAGE = Path(__file__).with_name('live_view.html')
LEVELS = 'OK', 'WARN', 'ERROR', 'STALE'


class View(Node):
    """Keeps the last picture and the last diagnostics as text for the page."""

    def __init__(self) -> None:
        super().__init__('live_view')
        self.statuses: dict[str, list[str]] = {}
        self.text, self.count = '{}', 0
        self.create_subscription(MarkerArray, 'stewart_dynamics/markers', self.on_markers, 1)
        self.create_subscription(DiagnosticArray, '/diagnostics', self.on_diagnostics, 10)

    def on_markers(self, message: MarkerArray) -> None:
        found = {(each.ns, each.id): each for each in message.markers}
        body = found['platform', 1]
        pose = body.pose
        self.count += 1
        self.text = json.dumps({
            'count': self.count,
            'base': [[p.x, p.y, p.z] for p in found['base', 1].points],
            'joints': [[p.x, p.y, p.z] for p in body.points],
            'position': [pose.position.x, pose.position.y, pose.position.z],
            'orientation': [pose.orientation.x, pose.orientation.y, pose.orientation.z,
                            pose.orientation.w],
            'names': [found['names', n].text for n in range(6)],
            'colors': [[c.r, c.g, c.b] for c in (found['pistons', n].color for n in range(6))],
            'text': found['singularity', 0].text, 'statuses': self.statuses})

    def on_diagnostics(self, message: DiagnosticArray) -> None:
        own = f'{self.get_namespace().rstrip("/")}/stewart_dynamics'.lstrip('/')
        for status in message.status:
            node, _, name = status.name.partition(': ')
            if node == own:
                self.statuses[name] = [LEVELS[status.level[0]], status.message]


async def serve(view: View, port: int, rate: float, ended: threading.Event) -> None:
    """Serve the page, and each new picture to all who look."""
    from websockets.asyncio.server import serve as serve_sockets
    from websockets.exceptions import ConnectionClosed

    def page(connection, request):
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
    while not signals and thread.is_alive():
        rclpy.spin_once(view, timeout_sec=0.1)
    ended.set()
    thread.join()
    view.destroy_node()
    rclpy.shutdown()
    if failed:
        sys.exit(failed[0])


if __name__ == '__main__':
    main()
