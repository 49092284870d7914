# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

"""
Rejects an environment in which ROS and Fast DDS would start less secure than it requires.

Where a keystore, a profile or a setting is missing or misspelt, both start without a message, and
without security. Each setting is explained in security/README.md.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
import os
from pathlib import Path
import re
import warnings

from stewart_dynamics.errors import StewartError

_OLD, _NEW = 'FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE'
PROFILE_VARIABLES = _OLD, _NEW
BUILTIN_TRANSPORTS, RANGE = 'FASTDDS_BUILTIN_TRANSPORTS', 'ROS_AUTOMATIC_DISCOVERY_RANGE'
# Discovery ranges with which a profile keeps its transports; ROS takes any other for LOCALHOST.
WIDE_RANGES = ('', 'SYSTEM_DEFAULT', 'SUBNET', 'OFF')
# Files of profiles that Fast DDS 2 and 3 load from the working folder.
DEFAULT_FILES = ('DEFAULT_FASTRTPS_PROFILES.xml', 'DEFAULT_FASTDDS_PROFILES.xml')
_VARIABLE = re.compile(r'\$\{([A-Z_][A-Z0-9_]*)\}')  # in the syntax of Fast DDS
_COMMENT = re.compile('<!--.*?-->', re.DOTALL)
_KEY_FILES = ('private_key_file', 'cert_chain_file', 'verify_file')
_ASKS_FOR_CERTIFICATES = re.compile(r'^\s*VerifyMode\s*=\s*Require\b', re.MULTILINE)


def _profiles() -> str:
    major = _version_of('rclpy').partition('.')[0]
    return _NEW if major.isdigit() and int(major) >= 9 else _OLD


def _version_of(library: str) -> str:
    """
    Return a library's version, by the names of the folders of its metadata; empty without one.

    ``importlib.metadata`` takes 20 ms, a fifth of the time by which the node starts later than a
    bare one.
    """
    found = find_spec(library)
    places = found.submodule_search_locations or () if found else ()
    names = sorted(each.name for place in places
                   for each in Path(place).parent.glob(f'{library}-*-info'))
    return ' '.join(name.removeprefix(f'{library}-') for name in names)


PROFILES = _profiles()
"""The variable with the file of Fast DDS's profiles; Fast DDS 3, of Kilted, has renamed it."""


def check_environment(arguments: Sequence[str]) -> str:
    """
    Return the text of a warning, empty without a reason for one.

    Raises StewartError, naming the variable, where security that is required would be missing.
    """
    permissive = _check_dds_security(arguments)
    rmw = os.environ.get('RMW_IMPLEMENTATION') or 'rmw_fastrtps_cpp'
    if 'fastrtps' in rmw:
        _check_profiles()
    return permissive


@contextmanager
def without_security_libraries() -> Iterator[None]:
    """Raise StewartError where the node cannot be made because Fast DDS has no DDS Security."""
    with warnings.catch_warnings():
        # of rclpy: two lines about an incomplete cleanup
        warnings.filterwarnings('ignore', 'Failed to fini', RuntimeWarning)
        try:
            yield
        except Exception as exc:
            if "doesn't have the security libraries" not in str(exc):
                raise
            raise StewartError(
                'ROS_SECURITY_ENABLE: true: but this Fast DDS is built without DDS Security, as '
                'that of the wheels from PyPI is; that of a ROS 2 installation has it') from exc


def _check_dds_security(arguments: Sequence[str]) -> str:
    enable = os.environ.get('ROS_SECURITY_ENABLE', '')
    if enable in ('', 'false'):
        return ''
    if enable != 'true':
        raise StewartError(f"ROS_SECURITY_ENABLE: '{enable}': must be true or false: ROS "
                           'reads everything but true as false')
    strategy = os.environ.get('ROS_SECURITY_STRATEGY', '')
    if strategy == 'Permissive':
        return ('ROS_SECURITY_STRATEGY is Permissive: without keys ROS runs without security')
    if strategy != 'Enforce':
        raise StewartError(f"ROS_SECURITY_STRATEGY: '{strategy}': must be Enforce where "
                           'ROS_SECURITY_ENABLE is true, or Permissive, with which ROS starts '
                           'without security where there are no keys')
    keystore = os.environ.get('ROS_SECURITY_KEYSTORE', '')
    named = [value for option, value in zip(arguments, arguments[1:], strict=False)
             if option in ('-e', '--enclave')]
    enclave = os.environ.get('ROS_SECURITY_ENCLAVE_OVERRIDE') or (named or ['/'])[-1]
    if not keystore:
        raise StewartError('ROS_SECURITY_KEYSTORE: not set, and ROS_SECURITY_ENABLE is true')
    if not (Path(keystore) / 'enclaves' / enclave.lstrip('/')).is_dir():
        raise StewartError(f"ROS_SECURITY_KEYSTORE: '{keystore}': holds no enclave '{enclave}'; "
                           'choose another with --ros-args --enclave NAME')
    return ''


def _check_profiles() -> None:
    """
    Check the file of profiles, which must be given by the name that this Fast DDS reads.

    Kilted loads a file of the old name as well, with a warning, but its processes do not get the
    transports in it.
    """
    other = _OLD if PROFILES == _NEW else _NEW
    path, of_other = os.environ.get(PROFILES), os.environ.get(other)
    if of_other and not path:
        raise StewartError(f'{other}: {of_other}: this Fast DDS reads {PROFILES} in its place')
    if PROFILES == _NEW and of_other and of_other != path:
        raise StewartError(
            f'{other}: {of_other}: must not be set, or be the file of {PROFILES}: ROS loads both')
    if path:
        _check_profile(Path(path))


def _check_profile(path: Path) -> None:
    from xml.etree import ElementTree  # a node without a profile does not need it

    try:
        # Fast DDS takes an empty line before <?xml, and -- in a comment.
        text = _COMMENT.sub('', path.read_text(encoding='utf-8')).lstrip()
        root = ElementTree.fromstring(text)
    except (OSError, UnicodeDecodeError, ElementTree.ParseError) as exc:
        reason = exc.strerror if isinstance(exc, OSError) else f'not XML: {exc}'
        raise StewartError(f'{PROFILES}: {path}: cannot be read: {reason}') from exc
    unset = [name for name in _VARIABLE.findall(text) if name not in os.environ]
    if unset:
        raise StewartError(f'{PROFILES}: {path}: the variable {unset[0]} is not set')
    elements = [(element.tag.rpartition('}')[2], _VARIABLE.sub(
        lambda found: os.environ[found[1]], element.text or '').strip())
        for element in root.iter()]
    kinds = {kind for kind, _ in elements}
    if ('useBuiltinTransports', 'false') in elements and kinds & {'interfaceWhiteList', 'tls'}:
        _check_that_nothing_replaces(path)
    for kind, name in elements:
        if kind in _KEY_FILES:
            _read(Path(name), f'{PROFILES}: {path}: {kind}')
    if {'tls', 'listening_ports'} <= kinds:
        name = os.environ.get('OPENSSL_CONF', '')
        if not name or not _ASKS_FOR_CERTIFICATES.search(_read(Path(name), 'OPENSSL_CONF')):
            raise StewartError(f"OPENSSL_CONF: '{name}': has no VerifyMode = Require: every "
                               'process could connect to the port of the profile')


def _check_that_nothing_replaces(path: Path) -> None:
    """Raise StewartError where ROS or Fast DDS adds transports to those of the profile."""
    discovery = os.environ.get(RANGE, '')
    if discovery not in WIDE_RANGES or os.environ.get('ROS_LOCALHOST_ONLY') == '1':
        raise StewartError(f'{PROFILES}: {path}: is not in effect where '
                           'ROS_AUTOMATIC_DISCOVERY_RANGE is LOCALHOST, as which ROS reads '
                           'unknown values, too: it adds shared memory and UDP on all addresses. '
                           'Set it to SYSTEM_DEFAULT, and ROS_LOCALHOST_ONLY not at all')
    for name in DEFAULT_FILES:
        if os.environ.get('SKIP_DEFAULT_XML_FILE') != '1' and Path(name).exists():
            raise StewartError(f'{PROFILES}: {path}: is replaced by {name} in the working folder '
                               'where SKIP_DEFAULT_XML_FILE is not 1')


def _read(path: Path, what: str) -> str:
    try:
        return path.read_text(encoding='utf-8')
    except (OSError, UnicodeDecodeError) as exc:
        reason = exc.strerror if isinstance(exc, OSError) else 'not UTF-8 text'
        raise StewartError(f'{what}: {path}: cannot be read: {reason}') from exc
