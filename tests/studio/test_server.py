"""The server answers its own page alone, reads no other files, and says in a sentence when its port is in use."""

import http.client
import socket

import pytest

from kpred.errors import ConfigError
from kpred.studio.server import free_port, is_own, is_plain, policy, start_server


@pytest.mark.parametrize(
    ("hosts", "origins", "expected"),
    [
        (["127.0.0.1:80"], [], True),
        (["localhost:80"], ["http://localhost:80"], True),
        (["127.0.0.1:80"], ["http://evil.example"], False),
        (["127.0.0.1:80"], ["null"], False),
        (["127.0.0.1:80"], ["http://localhost:80"], False),
        (["evil.example:80"], ["http://evil.example:80"], False),
        (["127.0.0.1:81"], [], False),
        ([], [], False),
        (["127.0.0.1:80", "evil.example"], [], False),
        (["127.0.0.1:80"], ["http://127.0.0.1:80", "http://evil.example"], False),
    ],
)
def test_only_the_own_page_is_answered(hosts: list[str], origins: list[str], expected: bool) -> None:
    assert is_own(hosts, origins, "127.0.0.1", 80) is expected


def test_a_server_for_all_addresses_still_refuses_other_origins() -> None:
    assert is_own(["192.168.1.7:80"], ["http://192.168.1.7:80"], "0.0.0.0", 80)
    assert not is_own(["192.168.1.7:80"], ["http://evil.example"], "0.0.0.0", 80)


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        ("/", True),
        ("/assets/index.js?x=..", True),
        ("/../secret", False),
        ("/a/../../secret", False),
        ("//etc/passwd", False),
        ("/a\\..\\b", False),
        ("etc/passwd", False),
    ],
)
def test_paths_stay_within_the_page(path: str, expected: bool) -> None:
    assert is_plain(path) is expected


def test_a_port_in_use_is_a_sentence() -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        with pytest.raises(ConfigError, match=f"127.0.0.1:{port}.*--port"):
            free_port("127.0.0.1", port)
    with pytest.raises(ConfigError, match="65535"):
        free_port("127.0.0.1", 70_000)


def test_the_running_server_keeps_to_itself() -> None:
    pytest.importorskip("viser", reason="viser is not installed (the extra studio)")
    server = start_server("127.0.0.1", 0)
    port = server.get_port()

    def status(path: str, **headers: str) -> tuple[int, str | None]:
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30)
        connection.request("GET", path, headers=headers)
        response = connection.getresponse()
        response.read()
        return response.status, response.getheader("Content-Security-Policy")

    try:
        assert status("/") == (200, policy(f"127.0.0.1:{port}"))
        assert status("/../../../__init__.py")[0] == 404
        assert status("//etc/hostname")[0] == 404
        assert status("/", Host="evil.example")[0] == 403
        assert status("/", Origin="http://evil.example")[0] == 403
        with pytest.raises(ConfigError, match=str(port)):
            start_server("127.0.0.1", port)
        # viser's offer of a public address leads nowhere.
        assert server.request_share_url() is None
    finally:
        server.stop()
