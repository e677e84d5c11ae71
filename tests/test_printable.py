"""What is printed: control characters of files have no effect, and a stream that is gone ends nothing."""

import io

import pytest
from rich.console import Console
from tracked import call, pictures

from servo.cli import terminal
from servo.cli.guard import Printer
from servo.report.words import Table

ESCAPES = "a\x1b[31mred\x1b]0;title\x07\x9b2J\r\u202e[bold]b"
SHOWN = r"a\x1b[31mred\x1b]0;title\x07\x9b2J\r\u202e[bold]b"


@pytest.mark.parametrize("shown", ["plain", "complain", "table"])
def test_control_characters_are_written_out(capfd, shown):
    if shown == "plain":
        terminal.plain(Console(), ESCAPES)
    elif shown == "complain":
        terminal.complain(ESCAPES)
    else:
        terminal.print_table(Console(), Table((ESCAPES,), [[ESCAPES]], (0,)))
    printed = "".join(capfd.readouterr())
    assert SHOWN in printed
    assert not set(printed) & set("\x1b\x07\x9b\r\u202e")


def test_a_picture_whose_name_has_escape_sequences(monkeypatch, capfd, tmp_path):
    monkeypatch.chdir(tmp_path)
    folder = pictures(tmp_path) / "in"
    (folder / "4\x1b[2J.png").write_bytes(b"no picture")
    code, out, err = call(
        monkeypatch, capfd, "in", "--region", "40,30,30,20", "--tracker", "frozen"
    )
    assert code == 1
    assert r"the first is 4\x1b[2J.png" in err
    assert "\x1b" not in out + err


def test_a_password_is_not_shown(monkeypatch, capfd, tmp_path):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "truth.txt").write_text("1,2,3,4\n")
    for password in ("secret", "sec@ret", "sec/ret", "s:e@c/r@et", "secret?#"):
        address = f"tcp://eye:{password}@127.0.0.1:1/one"
        for more in (["--region", "1,2,3,4"], ["--truth", "truth.txt"], ["--topic", "/eye"], []):
            code, out, err = call(monkeypatch, capfd, address, "--tracker", "frozen", *more)
            assert code == 2
            assert "tcp://eye:***@127.0.0.1:1/one" in err
            assert "ret" not in out + err.replace("truth", "")


def test_a_printer_goes_on_after_its_stream_is_gone():
    class Gone(io.StringIO):
        def write(self, _):
            raise BrokenPipeError(32, "Broken pipe")

    printer = Printer(Gone())
    assert printer.write("one") == 3
    assert printer.write("two") == 3
    printer.flush()


@pytest.mark.parametrize(
    ("error", "kept"),
    [
        (OSError(28, "No space left on device"), 28),
        (BrokenPipeError(32, "Broken pipe"), None),
        (ValueError("I/O operation on closed file"), None),
    ],
)
def test_a_printer_keeps_the_error_of_a_stream_that_refuses(error, kept):
    class Refusing(io.StringIO):
        def write(self, _):
            raise error

    printer = Printer(Refusing())
    printer.write("one")
    assert getattr(printer.refused, "errno", None) == kept
